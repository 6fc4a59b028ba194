"""A number over time against a limit with hysteresis, as of a Schmitt trigger."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slamreplay.geometry.times import NS_PER_S

#: A sample holds until the next one, up to the longer of this and three of the samples' usual
#: spacings, as for the verdict's own intervals; beyond that there is a gap.
BRIDGE_NS, HOLD_SPACINGS = NS_PER_S, 3


@dataclass(frozen=True)
class Excursion:
    """Times [start_ns, end_ns) at which a number was beyond its limit, and its worst value then."""

    start_ns: int
    end_ns: int
    worst: float

    @property
    def duration_ns(self) -> int:
        """How long it lasted."""
        return self.end_ns - self.start_ns


def excursions(
    t_ns: NDArray[np.int64],
    values: ArrayLike,
    limit: float,
    clear: float,
    *,
    above: bool,
    for_ns: int = 0,
) -> tuple[Excursion, ...]:
    """Stretches beyond a limit, each until the number is back on this side of `clear`.

    A gap ends a stretch, which then lasts one usual spacing beyond its last sample: what was not
    measured counts neither for nor against. After it the number must pass the limit anew.

    Args:
        t_ns: (N,) ascending.
        values: (N,) NaN where not known, as if there were no sample.
        limit: passed above it, or below it.
        clear: the limit itself, or a value on its good side.
        above: whether it must not go above; else not below.
        for_ns: shorter ones are left out.
    """
    sign = 1.0 if above else -1.0
    v = sign * np.asarray(values, dtype=np.float64)
    known = ~np.isnan(v)
    t, v = t_ns[known], v[known]
    if not len(t):
        return ()
    step = np.diff(t)
    usual = int(np.median(step)) if len(step) else 0
    is_gap = step > max(BRIDGE_NS, HOLD_SPACINGS * usual)
    until = np.append(np.where(is_gap, t[:-1] + usual, t[1:]), t[-1] + usual)
    begins = np.append(True, is_gap)
    enters, leaves = v > sign * limit, v <= sign * clear
    decided = enters | leaves | begins
    # In between the last sample that decided still holds; after a gap the first one always decides.
    last = np.maximum.accumulate(np.where(decided, np.arange(len(v)), 0))
    beyond = enters[last]
    first = np.flatnonzero(beyond & (begins | ~np.append(False, beyond[:-1])))
    final = np.flatnonzero(beyond & np.append(begins[1:] | ~beyond[1:], True))
    if not len(first):
        return ()
    worst = sign * np.maximum.reduceat(np.where(beyond, v, -np.inf), first)
    found = zip(t[first].tolist(), until[final].tolist(), worst.tolist(), strict=True)
    told = (Excursion(start, end, value) for start, end, value in found)
    return tuple(one for one in told if one.duration_ns >= for_ns)
