"""A time in which a covariance was too small, and the reasons to say so, merged into one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from slamreplay.geometry.times import NS_PER_S

#: Stretches that are no farther apart are one.
JOIN_NS = 2 * NS_PER_S


@dataclass(frozen=True)
class Stretch:
    """From when to when a covariance was too small, and why.

    Attributes:
        start_ns: onset.
        end_ns: end.
        reasons: by kind, a clause that goes on after "from 41.2 s for 12.5 s".
        n: rows of the belief in it.
        factor: sigma is too small by it; of one that shrank, by how much it did.
        p_value: of sound data; None for what needs no statistics.
        independent: whether a source that shares no evidence with the belief shows it.
    """

    start_ns: int
    end_ns: int
    reasons: Mapping[str, str]
    n: int
    factor: float
    p_value: float | None = None
    independent: bool = False


def merged(stretches: Iterable[Stretch]) -> list[Stretch]:
    """One stretch for all that overlap or nearly touch, in time order.

    What is measured against a source speaks first, an independent one before a shared one and the
    more striking before the less; a reason of one kind is told once. Where one of them needs no
    statistics the whole is a fact.
    """
    found: list[Stretch] = []
    for stretch in sorted(stretches, key=lambda s: (s.start_ns, s.end_ns)):
        if found and stretch.start_ns <= found[-1].end_ns + JOIN_NS:
            found[-1] = _both(found[-1], stretch)
        else:
            found.append(stretch)
    return found


def _both(one: Stretch, other: Stretch) -> Stretch:
    first, second = sorted(
        (one, other), key=lambda s: (s.p_value is None, not s.independent, -s.factor)
    )
    tested = [s.p_value for s in (one, other) if s.p_value is not None]
    return replace(
        first,
        start_ns=min(one.start_ns, other.start_ns),
        end_ns=max(one.end_ns, other.end_ns),
        reasons={**first.reasons, **second.reasons, **first.reasons},
        n=max(one.n, other.n),
        p_value=min(tested) if len(tested) == 2 else None,
        independent=one.independent or other.independent,
    )
