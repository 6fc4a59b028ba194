"""Which incidents the benchmark plays: every kind in turn, then every hard condition in turn.

Seeds are split once and for all: those below `HELD_FROM` are for development (thresholds and
calibration were set on some of them), those above are held and only ever used to score. A shorter
benchmark is the beginning of a longer one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from slamreplay.bench.conditions import CONDITIONS
from slamreplay.bench.incidents import KINDS

Split = Literal["held", "train"]

#: Twelve rounds of 17 kinds and 9 conditions: more than 300 logs, every kind at least 12 times.
DEFAULT_LOGS = 312
_ROUNDS_PER_SEED = 1000
HELD_FROM = 1_000_000
#: A map of elsewhere is not judged, so that the conditions have nothing to add to it.
_CONDITIONED = tuple(k for k in KINDS if k != "wrong_map")


@dataclass(frozen=True)
class Case:
    """One log of the benchmark: what `incident` takes."""

    kind: str
    seed: int
    conditions: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """As file and table name it."""
        return "-".join([self.kind, *self.conditions, str(self.seed)])


def schedule(
    logs: int = DEFAULT_LOGS,
    seed: int = 0,
    split: Split = "held",
    kinds: Sequence[str] = KINDS,
    conditions: Sequence[str] = tuple(CONDITIONS),
) -> tuple[Case, ...]:
    """The first `logs` cases of a seed.

    A round is each kind once, under no condition, and each condition once, under one kind; which
    one that is turns from round to round, so that every condition meets every kind in time.
    """
    cases: list[Case] = []
    round_of = 0
    while len(cases) < logs and (kinds or conditions):
        number = seed * _ROUNDS_PER_SEED + round_of + (HELD_FROM if split == "held" else 0)
        cases += [Case(kind, number) for kind in kinds]
        for i, name in enumerate(conditions):
            # 16 kinds: a step of 5 from round to round meets them all, a step of 3 within one.
            kind = _CONDITIONED[(5 * round_of + 3 * i) % len(_CONDITIONED)]
            cases.append(Case(kind, number, (name,)))
        round_of += 1
    return tuple(cases[:logs])
