"""Which levels of one seed come next: the whole ladder at once, then the middle of the bracket."""

from __future__ import annotations

import math
from collections.abc import Mapping

from slamreplay.doses.plan import MAX_HALVINGS, Axis
from slamreplay.replay.dose_statistics import bracket_of


def next_levels(axis: Axis, broken: Mapping[float, bool | None]) -> tuple[float, ...]:
    """Levels to try in the next round; none where the search has ended.

    The ladder is tried whole, for the picture needs all of it, and a response that is not monotonic
    shows. Then the first step that leads over the limit is halved until it is no wider than the
    tolerance.

    Args:
        axis: the perturbation.
        broken: by level that was tried, the baseline among them, whether it crosses the limit; None
            where that cannot be said.
    """
    ladder = tuple(level for level in axis.levels if level not in broken)
    if ladder or axis.tolerance is None:
        return ladder
    bracket = bracket_of({abs(level - axis.baseline): was for level, was in broken.items()})
    if bracket is None or not math.isfinite(bracket.broke) or bracket.broke == 0.0:
        return ()
    if axis.is_narrow(bracket.broke - bracket.held):
        return ()
    if len(broken) > len(axis.levels) + MAX_HALVINGS:
        return ()
    low, high = bracket.held, bracket.broke
    middle = math.sqrt(low * high) if axis.by_factor and low > 0.0 else (low + high) / 2.0
    level = axis.baseline + axis.side * middle
    rounded = float(f"{level:.4g}")  # a level that a person can type again
    near, far = sorted((axis.baseline + axis.side * low, axis.baseline + axis.side * high))
    level = rounded if near < rounded < far else level
    # One that cannot be said, tried again, would be asked for ever.
    return () if level in broken or not near < level < far else (level,)
