"""What makes a covariance no estimate: zeros, constants, 1e6, and one that never grows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Table
from slamreplay.geometry import se2, se3
from slamreplay.geometry.covariance import is_positive_definite, is_symmetric

#: Variances beyond these say "not measured": 0.03 mm, 300 m; a heading that may be any, and a rate.
LEAST, MOST, MOST_RAD2 = 1e-9, 1e5, 100.0
#: A robot that went or turned by so much was another one's guess if its covariance never changed.
MOVED_M, MOVED_RAD = 0.5, 0.5
FEWEST = 10
#: Dead reckoning over so many metres that ends no less sure than it began never counted its errors.
GROWN_M, GROWN = 5.0, 1.05

NOT_FINITE, ALL_ZERO = "not finite", "all zero"
ASYMMETRIC, INDEFINITE = "not symmetric", "not positive definite"
CONSTANT = "one and the same although the robot moved"
NO_GROWTH = "never larger however far the robot went"
OUT_OF_BOUNDS = "out of all bounds in an axis"
NOT_GIVEN = "marked as not given"

#: The block of x y yaw that a planar robot measures, in a 6x6 matrix; a sensor's three axes.
PLANAR, SPATIAL = (0, 1, 5), (0, 1, 2)


@dataclass(frozen=True, eq=False)
class Judged:
    """A column without its placeholders.

    Attributes:
        values: (N, k) the column, NaN where a number is a placeholder.
        faults: what is wrong, as a text, to the mask (N,) of the rows.
    """

    values: NDArray[np.float64]
    faults: Mapping[str, NDArray[np.bool_]]


@dataclass(frozen=True, eq=False)
class Moved:
    """How far a topic's poses went: (N,) metres so far, how far apart they lie, whether they drift.

    Poses that drift (dead reckoning) become less sure with the way.
    """

    way_m: se2.Array
    spread_m: float
    turned: float
    drifts: bool

    @property
    def at_all(self) -> bool:
        """Whether a covariance had reason to change."""
        return self.spread_m > MOVED_M or self.turned > MOVED_RAD


def moved_by(rows: Table, map_frame: str | None) -> Moved:
    """How far the poses of one topic went; those in the map do not drift."""
    if not len(rows):
        return Moved(np.zeros(0), 0.0, 0.0, drifts=False)
    xy, yaw = rows["position_xyz"][:, :2], se3.yaw_from_quaternion(rows["orientation_xyzw"])
    xy = np.where(np.isfinite(xy), xy, 0.0)
    steps = np.hypot(*np.diff(xy, axis=0).T)
    way = np.append(0.0, np.cumsum(np.where(steps > 1e-4, steps, 0.0)))
    drifts = rows.schema.name == "odometry" and str(rows["frame_id"][0]) != map_frame
    turned = float(np.ptp(np.unwrap(yaw[np.isfinite(yaw)]))) if np.isfinite(yaw).any() else 0.0
    return Moved(way, float(np.ptp(xy, axis=0).max()), turned, drifts)


def judge_covariances(cov: se2.Array, axes: tuple[int, ...], moved: Moved | None) -> Judged:
    """What is wrong with covariances, and what is left of them.

    Args:
        cov: (N, n, n) of one topic, n 6 or 3, as they were recorded.
        axes: those that count; the others are left as they are.
        moved: of poses, how far they went. The noise of a sensor may well be a constant.
    """
    n, size = cov.shape[0], cov.shape[1]
    block = cov[:, np.array(axes)[:, None], np.array(axes)]
    told = ~np.isnan(block).all(axis=(1, 2))
    marked = told & (size == 3) & (cov[:, 0, 0] == -1.0)
    zero = told & (block == 0.0).all(axis=(1, 2))
    variance = np.diagonal(block, axis1=1, axis2=2)
    most = np.full(len(axes), MOST)
    most[2:] = MOST_RAD2 if size == 6 else MOST
    with np.errstate(invalid="ignore"):
        tiny = variance <= LEAST if moved is not None else np.zeros_like(variance, dtype=bool)
        bad_axis = (tiny & (variance >= 0.0)) | (variance >= most)
    infinite = told & ~np.isfinite(block).all(axis=(1, 2))
    bad_axis |= ~np.isfinite(variance)
    asymmetric, indefinite = _odd(block, bad_axis)
    usual = told & ~zero & ~marked
    given = block[told & ~zero]
    same = len(given) >= FEWEST and bool((given == given[:1]).all())
    constant = np.broadcast_to(moved is not None and moved.at_all and same, n)
    stuck = np.broadcast_to(moved is not None and not same and _never_grows(variance, moved), n)
    faults = {
        NOT_GIVEN: marked,
        NOT_FINITE: infinite & ~marked,
        ALL_ZERO: zero,
        ASYMMETRIC: usual & asymmetric,
        INDEFINITE: usual & indefinite,
        CONSTANT: told & constant & ~zero & ~marked,
        NO_GROWTH: told & stuck & ~zero & ~marked,
    }
    rest = told & ~np.logical_or.reduce(list(faults.values()))
    faults[OUT_OF_BOUNDS] = rest & bad_axis.any(axis=1)
    values = cov.copy()
    odd = usual & (asymmetric | indefinite)
    whole = marked | zero | odd | faults[CONSTANT] | faults[NO_GROWTH]
    values[whole] = np.nan
    for place, axis in enumerate(axes):
        rows = np.flatnonzero(told & bad_axis[:, place])
        values[rows, axis, :] = np.nan
        values[rows, :, axis] = np.nan
    return Judged(values.reshape(n, size * size), faults)


def _odd(
    block: se2.Array, bad_axis: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(N,) not symmetric, and (N,) symmetric with a negative eigenvalue, in axes not bad anyway."""
    keep = ~bad_axis
    inside = np.where(keep[:, :, None] & keep[:, None, :], block, 0.0)
    finite = np.isfinite(inside).all(axis=(1, 2))
    inside[~finite] = 0.0
    scale = np.maximum(np.abs(inside).max(axis=(1, 2), initial=0.0), 1e-12)
    # A hair is added to the diagonal: a variance of zero is no measurement, but no contradiction.
    lifted = inside + (1e-9 * scale)[:, None, None] * np.eye(block.shape[1])
    if not len(lifted):
        return np.zeros(0, dtype=np.bool_), np.zeros(0, dtype=np.bool_)
    # Sensors repeat theirs: each run of equal ones is looked at once.
    first = np.append(True, (lifted[1:] != lifted[:-1]).any(axis=(1, 2)))
    run = np.cumsum(first) - 1
    even, sound = is_symmetric(lifted[first])[run], is_positive_definite(lifted[first])[run]
    return finite & ~even, ~finite | (even & ~sound)


def _never_grows(variance: se2.Array, moved: Moved) -> bool:
    way = moved.way_m
    if not moved.drifts or not len(way) or way[-1] < GROWN_M:
        return False
    total = variance[:, 0] + variance[:, 1]
    first, last = total[way <= 0.2 * way[-1]], total[way >= 0.8 * way[-1]]
    if not (np.isfinite(first).any() and np.isfinite(last).any()):
        return False
    return float(np.nanmedian(last)) <= GROWN * float(np.nanmedian(first))
