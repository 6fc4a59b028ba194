"""How well a measure parts moments that are lost from moments in which the map had changed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.labs.lost_or_changed.trials import Trial

#: One moment in so many is asked: scans of one second are hardly different.
_THIN = 5
_RESAMPLES = 400


def parting(trials: Sequence[Trial], name: str, *, low_is_lost: bool = False) -> list[float | None]:
    """Area under the ROC curve of one measure, and its 95 % interval; None where it has none.

    How often a lost moment has the larger value than a changed one, ties counted half (Mann and
    Whitney 1947, Annals of Mathematical Statistics 18, 50-60); 0.5 is chance. Moments that are both
    or neither are left out. The interval is the percentile interval of a bootstrap over logs
    (Efron 1979, Annals of Statistics 7, 1-26), for the moments of one log are not independent.

    Args:
        trials: the logs.
        name: of the measure.
        low_is_lost: whether small values speak for lost.
    """
    parts = [_asked(one, name) for one in trials]
    values = np.concatenate([v for v, _ in parts])
    lost = np.concatenate([flags for _, flags in parts])
    log = np.repeat(np.arange(len(parts)), [len(v) for v, _ in parts])
    if low_is_lost:
        values = -values
    area = _area(values, lost, np.ones(len(values)))
    if area is None:
        return [None, None, None]
    rng = np.random.Generator(np.random.PCG64(len(trials)))
    draws = rng.multinomial(len(parts), np.full(len(parts), 1.0 / len(parts)), size=_RESAMPLES)
    found = [_area(values, lost, draw[log].astype(np.float64)) for draw in draws]
    ends = np.quantile([f for f in found if f is not None], [0.025, 0.975])
    return [area, float(ends[0]), float(ends[1])]


def _asked(trial: Trial, name: str) -> tuple[se2.Array, NDArray[np.bool_]]:
    """Values (M,) of the moments that are one of the two, and whether they are lost."""
    values = trial.measures[name]
    rows = np.flatnonzero((trial.lost ^ trial.changed) & np.isfinite(values))[::_THIN]
    return values[rows], trial.lost[rows]


def _area(values: se2.Array, lost: NDArray[np.bool_], weights: se2.Array) -> float | None:
    """The area with moments (M,) counted by weight; None where one of the two is absent."""
    levels, row = np.unique(values, return_inverse=True)
    of_lost = np.bincount(row, weights * lost, len(levels))
    of_changed = np.bincount(row, weights * ~lost, len(levels))
    pairs = of_lost.sum() * of_changed.sum()
    if pairs <= 0.0:
        return None
    below = np.cumsum(of_changed) - of_changed
    return float(of_lost @ (below + 0.5 * of_changed) / pairs)
