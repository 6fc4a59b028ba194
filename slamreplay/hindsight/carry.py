"""Every scan gets a pose: carried by odometry from keyframe to keyframe."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.hindsight.beams import HIT, Beams
from slamreplay.hindsight.keyframes import MIN_POINTS
from slamreplay.hindsight.smoothing import MIN_SCORE, floor_covariance, match_covariance
from slamreplay.hindsight.way import between_keyframes
from slamreplay.matching.correlative import Window, match_each
from slamreplay.matching.field import ScoreField
from slamreplay.matching.thinning import thin

WINDOW = Window(0.1, 0.1, 0.09, 0.03, pull=0.05)
#: The same where odometry missed much of the way (slip, a robot that is carried).
WIDE = Window(0.4, 0.1, 0.36, 0.04, pull=0.05)
#: Scans that are matched in one go: their points are held at once.
_AT_ONCE = 4000


def carry(
    odometry: se2.Array,
    keys: NDArray[np.int64],
    poses: se2.Array,
    is_open: NDArray[np.bool_],
    beams: Beams,
    field: ScoreField,
) -> tuple[se2.Array, NDArray[np.int64], se2.Array]:
    """Poses (N, 3) of all scans, the keyframe (N,) each shares its trust with, and its doubt.

    The doubt (N, 3) is how far off in x, y and yaw the pose may be for what odometry missed.

    Between two keyframes the scans follow odometry; what it misses on the way is spread evenly over
    the time. Over an open link (kidnapped, chain broken) each scan goes to the side it fits.

    Args:
        odometry: (N, 3) odometry at the scans.
        keys: (K,) indices of the keyframes among the scans, ascending, K >= 1.
        poses: (K, 3) their poses.
        is_open: (K - 1,) links over which the motion is not known.
        beams: the scans.
        field: score field of the map, to choose sides.
    """
    way = between_keyframes(beams.t_ns, odometry, keys, poses)
    carried, before, after = way.xyyaw, way.before, way.after
    share = np.where(way.part > 0.5, after, before)
    over = np.zeros(len(odometry), dtype=bool)
    if len(is_open):
        over = is_open[np.minimum(before, len(is_open) - 1)] & (after > before)
    if over.any():
        later = scan_scores(field, beams, way.back) > scan_scores(field, beams, way.ahead)
        carried[over] = np.where(later[:, None], way.back, way.ahead)[over]
        share[over] = np.where(later, after, before)[over]
    carried[keys], share[keys] = poses, np.arange(len(keys))
    doubt = np.minimum(way.part, 1.0 - way.part)[:, None] * np.abs(way.missing)
    doubt[:, :2] = np.hypot(doubt[:, 0], doubt[:, 1])[:, None]
    doubt[over] = 0.0
    return carried, share, doubt


def settle(
    carried: se2.Array,
    cov: se2.Array,
    odometry: se2.Array,
    near: NDArray[np.int64],
    doubt: se2.Array,
    beams: Beams,
    field: ScoreField,
) -> tuple[se2.Array, se2.Array]:
    """Poses (N, 3) and covariances (N, 3, 3) after each scan was weighed against the map itself.

    Odometry is stamped late, or slips, between keyframes; the scan's own match corrects the pose as
    far as odometry may be wrong over the way from its keyframe.

    Args:
        carried: (N, 3) poses as odometry carries them; NaN rows stay.
        cov: (N, 3, 3) covariances of the keyframes they were carried from.
        odometry: (N, 3) odometry at the scans.
        near: (N,) the scan that is the keyframe of each.
        doubt: (N, 3) how far off the carried pose may be, as `carry` has it.
        beams: the scans.
        field: score field of the map.
    """
    way = se2.between(odometry[near], odometry)
    sigma_m = 0.02 + 0.1 * np.hypot(way[:, 0], way[:, 1]) + 0.03 * np.abs(way[:, 2])
    sigma = np.stack([sigma_m, sigma_m, 0.005 + 0.4 * np.abs(way[:, 2])], axis=1)
    sigma = np.hypot(sigma, doubt)
    is_wide = np.any(doubt > np.array([0.08, 0.08, 0.06]), axis=1)
    # What the map is off by is the same for both: it is set aside, or two of them would better it.
    floor = floor_covariance(field)
    poses, spread = carried.copy(), cov - floor
    moved = np.flatnonzero(np.isfinite(carried).all(axis=1) & (near != np.arange(len(near))))
    spread[moved] += sigma[moved, :, None] ** 2 * np.eye(3)
    for first in range(0, len(moved), _AT_ONCE):
        some = moved[first : first + _AT_ONCE]
        clouds = [thin(beams.points(k), 0.1) for k in some.tolist()]
        enough = np.array([len(points) >= MIN_POINTS for points in clouds])
        windows = [WIDE if w else WINDOW for w in is_wide[some].tolist()]
        tops = match_each(field, clouds, carried[some], windows)
        off = tops.xyyaw - carried[some]
        reach_m = np.array([w.reach_m for w in windows])
        reach_rad = np.array([w.reach_rad for w in windows])
        fits = enough & (tops.score >= MIN_SCORE) & (np.abs(off[:, 2]) <= reach_rad + 0.06)
        fits &= np.hypot(off[:, 0], off[:, 1]) <= reach_m + 0.2
        held, off = some[fits], off[fits]
        measured = match_covariance(tops.information[fits], tops.score[fits])
        prior = spread[held]
        gain = prior @ np.linalg.inv(prior + measured)
        poses[held] = carried[held] + np.einsum("nij,nj->ni", gain, off)
        spread[held] = prior - gain @ prior
    return poses, 0.5 * (spread + np.swapaxes(spread, 1, 2)) + floor


def scan_scores(field: ScoreField, beams: Beams, poses: se2.Array) -> se2.Array:
    """(N,) mean score of each scan's hits at poses (N, 3); NaN without a hit or a pose."""
    out = np.full(len(poses), np.nan)
    _scan_scores(
        field.values,
        field.resolution_m,
        field.corner_xy,
        beams.ends,
        beams.kind,
        np.ascontiguousarray(poses),
        out,
    )
    return out


@njit(cache=True)
def _scan_scores(values, resolution, corner, ends, kind, poses, out):  # type: ignore[no-untyped-def]
    height, width = values.shape
    for s in range(poses.shape[0]):
        if not np.isfinite(poses[s, 0]):
            continue
        cos, sin = np.cos(poses[s, 2]), np.sin(poses[s, 2])
        total, count = 0.0, 0
        for b in range(ends.shape[1]):
            if kind[s, b] != HIT:
                continue
            x = poses[s, 0] + cos * ends[s, b, 0] - sin * ends[s, b, 1]
            y = poses[s, 1] + sin * ends[s, b, 0] + cos * ends[s, b, 1]
            col = int(np.floor((x - corner[0]) / resolution))
            row = int(np.floor((y - corner[1]) / resolution))
            count += 1
            if 0 <= row < height and 0 <= col < width:
                total += values[row, col]
        if count:
            out[s] = total / count
