"""SR-MAP-FRAME: the belief is off by one constant transform over the whole log.

Then either the map that is judged against lies elsewhere than the robot's own, or the robot was put
down wrongly and never corrected. The first is sure where the localizer kept correcting itself (it
moved the belief against its odometry, or no drift added up) and stayed at the same offset although
its scans do not fit this map there; where they fit as well as in the right place, it sat in a
look-alike place and was lost.
"""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.verdict.belief_error import BeliefError
from slamreplay.verdict.fit_at import fits_at_belief
from slamreplay.verdict.judgement import Cause, ConstantOffset
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.wander import is_pulled_back

#: The offset is constant where nine of ten rows stay this close to it (a noisy localizer's heading
#: leaves it by 6 deg), and it covers this share of what was judged, over at least so many seconds.
SPREAD_M, SPREAD_RAD, SHARE, MIN_S = 0.5, np.radians(10.0), 0.8, 10.0
#: A localizer that moved the belief by this much against its odometry was correcting it.
CORRECTED_M, CORRECTED_RAD = 0.15, np.radians(4.0)
#: Less than this against its odometry is rounding: nothing was corrected at all.
MOVED_M, MOVED_RAD = 0.03, np.radians(0.5)
#: Its belief follows hindsight where odometry drifts away from both: slope and correlation of what
#: it corrected on what there was to correct, if that was this much at all.
FOLLOWS_SLOPE, FOLLOWS_R, DRIFTED_M = 0.5, 0.6, 0.08
#: One aisle off in a hall of like aisles scans score 0.59 to 0.77 of what they do in the right
#: place, in a map that lies elsewhere 0.02 to 0.33 (16 development logs of seeds 5000 to 5011, all
#: that are asked): beyond this part the robot sat in a look-alike place.
LOOKALIKE = 0.45


def constant_offset(view: BundleView, error: BeliefError, limits: Limits) -> ConstantOffset | None:
    """The one transform between belief and hindsight, None where there is none worth a word."""
    rows = error.known & np.isfinite(error.distance_m)
    judged = error.known & error.spoken
    if rows.sum() < 10 or rows.sum() < SHARE * judged.sum():
        return None
    if (error.t_ns[rows][-1] - error.t_ns[rows][0]) / 1e9 < MIN_S:
        return None
    offset = _aligned(error.where[rows], error.belief[rows])
    rest = error.belief[rows] - se2.compose(offset, error.where[rows])
    rest[:, 2] = se2.wrap_angle(rest[:, 2])
    spread_m = float(np.quantile(np.hypot(rest[:, 0], rest[:, 1]), 0.9))
    spread_rad = float(np.quantile(np.abs(rest[:, 2]), 0.9))
    at_robot_m = float(np.median(error.distance_m[rows]))
    at_robot_rad = float(abs(offset[2]))
    if at_robot_m < limits.frame_offset_m and at_robot_rad < limits.frame_offset_rad:
        return None
    if spread_m > min(SPREAD_M, max(0.5 * at_robot_m, 0.05)) or spread_rad > SPREAD_RAD:
        return None
    # Nine rows of ten leave room for the stretch before a kidnap, in which the belief was right.
    apart = (np.hypot(rest[:, 0], rest[:, 1]) > limits.position_m) | (
        np.abs(rest[:, 2]) > limits.yaw_rad
    )
    held_s = np.diff(error.t_ns[rows], append=error.t_ns[rows][-1]) / 1e9
    right = apart & ~error.off(limits)[rows]
    if float(np.minimum(held_s, 1.0)[right].sum()) >= limits.lost_s:
        return None
    cause: Cause = "map_or_start"
    if _corrected(view, error, rows, rest, spread_m):
        cause = "lookalike" if fits_at_belief(view, error, rows, LOOKALIKE) else "map"
    whole = (float(offset[0]), float(offset[1]), float(offset[2]))
    return ConstantOffset(whole, at_robot_m, at_robot_rad, spread_m, cause)


def _aligned(source: se2.Array, target: se2.Array) -> se2.Array:
    """(3,) the transform that takes poses (N, 3) onto others, by headings and medians.

    Headings carry the turn: they do not need the robot to have driven far. A path longer than a few
    metres gives it better (planar Procrustes, once more without the rows that fit badly).
    """
    turns = se2.wrap_angle(target[:, 2] - source[:, 2])
    yaw = float(np.arctan2(np.median(np.sin(turns)), np.median(np.cos(turns))))
    rows = np.ones(len(source), dtype=bool)
    for _ in range(2):
        a, b = (p[rows, :2] - p[rows, :2].mean(axis=0) for p in (source, target))
        if np.sqrt((a**2).sum(axis=1).mean()) > 2.0:
            cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
            better = float(np.arctan2(cross.sum(), (a * b).sum()))
            yaw = better if abs(se2.wrap_angle(better - yaw)) < SPREAD_RAD else yaw
        turned = se2.compose(np.array([0.0, 0.0, yaw]), source)
        shift = np.median(target[:, :2] - turned[:, :2], axis=0)
        rest = np.hypot(*(target[:, :2] - turned[:, :2] - shift).T)
        rows = rest <= 3.0 * np.median(rest)
    return np.array([shift[0], shift[1], yaw])


def _corrected(
    view: BundleView, error: BeliefError, rows: np.ndarray, rest: se2.Array, spread_m: float
) -> bool:
    """Whether the localizer kept the belief where it was, against the drift of its odometry."""
    pulled = is_pulled_back(error.where[rows], rest)
    odometry = odometry_track(view)
    if odometry is None or not len(odometry):
        return pulled
    odom = odometry.at(error.t_ns[rows]).xyyaw
    sound = np.isfinite(odom).all(axis=1)
    if sound.sum() < 2:
        return False
    believed, odom = error.belief[rows][sound], odom[sound]
    carried = se2.compose(believed[0], se2.between(odom[0], odom))
    moved = np.hypot(*(believed - carried)[:, :2].T)
    turned = np.abs(se2.wrap_angle(believed[:, 2] - carried[:, 2]))
    far, wide = float(np.quantile(moved, 0.9)), float(np.quantile(turned, 0.9))
    if far > max(CORRECTED_M, 3.0 * spread_m) or wide > CORRECTED_RAD:
        return True
    if far < MOVED_M and wide < MOVED_RAD:
        return False
    if pulled:
        return True
    # Odometry laid over the belief as a whole: what is left is what there was to correct.
    aligned = se2.compose(_aligned(odom, believed), odom)
    where = error.where[rows][sound]
    there = se2.compose(_aligned(where, believed), where)
    due, done = ((track - aligned)[:, :2] for track in (there, believed))
    if float(np.quantile(np.hypot(due[:, 0], due[:, 1]), 0.9)) < DRIFTED_M:
        return False
    both, own = float((due * done).sum()), float((due**2).sum())
    r = both / np.sqrt(own * max(float((done**2).sum()), 1e-12))
    return bool(both / own > FOLLOWS_SLOPE and r > FOLLOWS_R)
