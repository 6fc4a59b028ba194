"""What is known of a level over a few seeds, and of a difference between pairs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from scipy.special import bdtr, stdtrit

from slamreplay.replay.dose import Critical, Outcome, Paired

_CONFIDENCE = 0.95


@dataclass(frozen=True)
class Bracket:
    """Between which two levels of one seed a limit is crossed, as distances from the baseline.

    Attributes:
        held: greatest one below the crossing that held; 0 is the baseline.
        broke: least one that did not; infinite where all held, 0 where the baseline did not.
    """

    held: float
    broke: float


def bracket_of(broken: Mapping[float, bool | None]) -> Bracket | None:
    """The first crossing among the distances that were tried, None where none has a number.

    A response need not be monotonic: what holds again farther out does not count.

    Args:
        broken: by distance, whether the limit is crossed there; the baseline is 0. None has no
            number, and is passed over.
    """
    held = None
    for distance in sorted(broken):
        if broken[distance]:
            return Bracket(distance if held is None else held, distance)
        if broken[distance] is not None:
            held = distance
    return None if held is None else Bracket(held, math.inf)


def holds_again(broken: Mapping[float, bool | None]) -> list[float]:
    """Distances beyond the first crossing at which the limit is kept again."""
    bracket = bracket_of(broken)
    if bracket is None:
        return []
    return [d for d in sorted(broken) if d > bracket.broke and broken[d] is False]


def median_ranks(n: int) -> tuple[int, float]:
    """Rank k, and how often the median lies between the order statistics k and n - 1 - k.

    Whatever the distribution: 1 - 2 P(Bin(n, 1/2) <= k) (David and Nagaraja 2003, Order Statistics,
    section 7.1). The greatest k with 95 % or more; below six there is none, and it is 0 with what
    it has: 0.9375 of five.
    """
    enough = [k for k in range(n // 2) if 1.0 - 2.0 * bdtr(k, n, 0.5) >= _CONFIDENCE]
    rank = enough[-1] if enough else 0
    return rank, 1.0 - 2.0 * float(bdtr(rank, n, 0.5)) if n > 1 else 0.0


def critical_of(
    metric: str, brackets: Sequence[Bracket | None], baseline: float, side: int
) -> Critical:
    """The critical level over seeds, from the bracket of each.

    The interval goes from an order statistic of the levels that held to one of those that broke: a
    crossing lies somewhere in its bracket.

    Args:
        metric: whose limit.
        brackets: of each seed, None of one without a number.
        baseline: the level that changes nothing.
        side: 1 where levels lie above it, -1 below.
    """
    known = [bracket for bracket in brackets if bracket is not None]
    if not known:
        return Critical(metric, "not_applicable", None, None, None, 0, 0, None)
    n = len(known)
    held, broke = sorted(b.held for b in known), sorted(b.broke for b in known)
    rank, confidence = median_ranks(n)
    middle = broke[(n - 1) // 2]
    crossed = sum(math.isfinite(distance) for distance in broke)
    outcome: Outcome = "crossed"
    if middle == 0.0:
        outcome = "always"
    elif not math.isfinite(middle):
        outcome = "partly" if crossed else "never"

    def level(distance: float) -> float | None:
        # 1 - 0.3 is not what the recipe says: back to the digits that levels have.
        return float(f"{baseline + side * distance:.12g}") if math.isfinite(distance) else None

    return Critical(
        metric, outcome, level(middle), level(held[rank]), level(broke[n - 1 - rank]), crossed, n,
        confidence if n > 1 else None,
    )  # fmt: skip


def paired(pairs: Sequence[tuple[float, float]]) -> Paired | None:
    """Mean of with minus without, and Student's 95 % interval (1908, Biometrika 6, 1-25).

    Args:
        pairs: with and without, of the same seed; None comes back where there are none.
    """
    n = len(pairs)
    if not n:
        return None
    differences = [a - b for a, b in pairs]
    mean = math.fsum(differences) / n
    if n == 1:
        return Paired(mean, None, None, 1)
    variance = math.fsum((d - mean) ** 2 for d in differences) / (n - 1)
    half = float(stdtrit(n - 1, 0.5 + _CONFIDENCE / 2.0)) * math.sqrt(variance / n)
    return Paired(mean, mean - half, mean + half, n)
