"""By how much one heading lags behind another, regressed in each turn and pooled over the turns.

In a turn the lag times the turn rate is what two headings differ by, beside a constant, a drift and
a share of the turn (scale errors of the odometry), none of which looks like a turn rate.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.verdict.headings import Heading

#: A turn whose rate changes less than this is too even to tell a delay from a drift.
SWING_RAD_S = 0.3
#: Scans of a turn that the regression needs.
LEAST_SCANS = 10
#: Longer delays than this leave the turn that shows them.
LONGEST_S = 1.5
#: No turn tells a lag closer than this, however well its line fits.
_FLOOR_S = 0.004
#: Headings of odometry and map part by so much within a second, without any delay.
DRIFT_RAD = 0.006


def pooled_lag(
    seen: Heading, other: Heading, turns: list[NDArray[np.int64]]
) -> tuple[float, float, int] | None:
    """By how much `seen` lags behind the other.

    Args:
        seen: headings at the M moments of all turns, one turn after the other.
        other: asked at those moments, and so much earlier.
        turns: of each turn the moments, M in all; only how many they are counts here.

    Returns:
        The lag and its standard deviation in seconds, and how many turns tell it; None where fewer
        than two do.
    """
    edges = np.cumsum([0, *map(len, turns)])
    late, found = 0.0, None
    for _ in range(4):  # a delay of half a turn is not small: go back in time and ask again
        lags = []
        for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            t, y = seen.t_ns[a:b], seen.yaw[a:b]
            lag = _turn_lag(t, y - other.at(t, late), other.at(t, late), other.rate(t, late))
            if lag is not None:
                lags.append(lag)
        if len(lags) < 2:
            return None
        found = _combined(np.array(lags))
        late = float(np.clip(late + found[0], -LONGEST_S, LONGEST_S))
        if abs(found[0]) < 1e-3:
            break
    return None if found is None else (late, found[1], found[2])


def _turn_lag(
    t_ns: NDArray[np.int64], apart: se2.Array, yaw: se2.Array, rate: se2.Array
) -> tuple[float, float] | None:
    """Seconds and their sigma of one turn; least squares with Huber's (1964) weights."""
    ok = np.isfinite(apart) & np.isfinite(rate)
    if ok.sum() < LEAST_SCANS or np.ptp(rate[ok]) < SWING_RAD_S:
        return None
    t = (t_ns[ok] - t_ns[ok][0]) / NS_PER_S
    turned = yaw[ok] - yaw[ok].mean()
    columns = np.column_stack([np.ones(len(t)), t - t.mean(), turned, -rate[ok]])
    y = np.unwrap(apart[ok])
    weight = np.ones(len(t))
    for _ in range(3):
        scaled = columns * weight[:, None]
        # A hint of ridge: of a steady turn its share and its time are the same thing.
        normal = scaled.T @ columns + np.diag([1e-9, 1e-9, 1e-2, 1e-6])
        inverse = np.linalg.inv(normal)
        solved = inverse @ (scaled.T @ y)
        rest = y - columns @ solved
        # 1.4826 makes a standard deviation of a normal's median absolute deviation.
        sigma = max(1.4826 * float(np.median(np.abs(rest))), 0.002)
        weight = np.minimum(1.0, 2.0 * sigma / np.maximum(np.abs(rest), 1e-9))
    # What is left is not white: odometry drifts and maps bend over a second. A long even turn,
    # whose turn rate looks like such a drift, gets the large sigma that it deserves.
    row = (inverse @ scaled.T)[3]
    alike = DRIFT_RAD**2 * np.exp(-np.abs(t[:, None] - t[None, :]))
    return float(solved[3]), float(np.sqrt(row @ alike @ row + sigma**2 * (row @ row)))


def _combined(lags: se2.Array) -> tuple[float, float, int]:
    """Mean of the turns' lags (N, 2), robust; its sigma grows where they disagree."""
    lag, sigma = lags[:, 0], np.hypot(lags[:, 1], _FLOOR_S)
    centre = _weighted_median(lag, 1.0 / sigma)
    for _ in range(5):
        off = np.abs(lag - centre) / sigma
        weight = np.minimum(1.0, 2.0 / np.maximum(off, 1e-9)) / sigma**2
        centre = float((weight * lag).sum() / weight.sum())
    off = np.abs(lag - centre) / sigma
    excess = max(1.0, 1.4826 * _weighted_median(off, 1.0 / sigma))
    spread = excess / np.sqrt(weight.sum())
    return centre, float(np.hypot(spread, _FLOOR_S / np.sqrt(len(lag)))), len(lag)


def _weighted_median(values: se2.Array, weights: se2.Array) -> float:
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])
