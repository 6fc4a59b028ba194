"""Where an estimator starts, and where somebody set the robot's pose again.

A localizer starts from the pose that a person or a program gave it. A log that begins later shows
it by its first belief.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.belief import arrival_ns, recorded_belief
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.geometry import se2, se3
from slamreplay.geometry.covariance import ANY_ANGLE, planar_from_ros

#: nav2_amcl's covariance of a start whose own is unknown: 0.5 m, 0.5 m, 15 deg.
DEFAULT_COV = np.diag([0.25, 0.25, (np.pi / 12.0) ** 2])

#: Settings a perturbation may change: metres ahead along the start's heading and to the left of it,
#: radians to the left, the standard deviation that its place is told with beside its own, m,
OFFSET, LEFT = "initial_pose_offset_m", "initial_pose_left_m"
ROTATE, SIGMA = "initial_pose_rotate_rad", "initial_pose_sigma_m"
MOVED = frozenset({OFFSET, LEFT, ROTATE, SIGMA})
#: and 1 for a start that knows nothing.
GLOBAL = "initial_pose_global"
#: Tables that a recorded belief is composed of.
_BELIEVED = frozenset({"transforms", "odometry", "poses"})
#: What a clicked start is told with: 15 deg where its place is told to 0.5 m.
RAD_PER_M = np.radians(15.0) / 0.5


@dataclass(frozen=True, eq=False)
class Start:
    """A pose that an estimator is given.

    Attributes:
        row: from which row on it holds.
        xyyaw: (3,) base in map at that row; None means it may be anywhere.
        cov: (3, 3) of it.
    """

    row: int
    xyyaw: se2.Array | None
    cov: se2.Array


def starts(
    view: BundleView,
    t_ns: NDArray[np.int64],
    T_odom_base: se2.Array,
    told: tuple[se2.Array, se2.Array] | None = None,
) -> list[Start]:
    """Every pose that is given to an estimator, in order of rows; empty where nobody said any.

    Args:
        view: the log, and the settings that perturb its first start.
        t_ns: (N,) times of the estimator's rows, sorted.
        T_odom_base: (N, 3) odometry at these times, NaN where unknown: there nothing starts.
        told: pose (3,) and covariance (3, 3) to begin with instead of the first recorded belief.

    Raises:
        NotApplicableError: the first start is to be moved, and there is none.
    """
    rows = np.flatnonzero(np.isfinite(T_odom_base).all(axis=1))
    found = given(view, t_ns, T_odom_base)
    belief = recorded_belief(_undisturbed(view), t_ns[rows]) if told is None else None
    if told is not None and len(rows) and (not found or rows[0] < found[0].row):
        found.insert(0, Start(int(rows[0]), *told))
    if belief is not None and belief.has_pose.any():
        k = int(np.argmax(belief.has_pose))
        if not found or rows[k] < found[0].row:
            found.insert(0, Start(int(rows[k]), belief.xyyaw[k], _sound(belief.cov[k])))
    if found:
        found[0] = _perturbed(found[0], view)
    elif view.settings.get(GLOBAL) and len(rows):
        found = [Start(int(rows[0]), None, DEFAULT_COV)]
    elif not MOVED.isdisjoint(view.settings):
        raise NotApplicableError("the log has no start that could be moved")
    return found


def given(view: BundleView, t_ns: NDArray[np.int64], T_odom_base: se2.Array) -> list[Start]:
    """Every initial pose in the log, in order of the rows from which on it held; see `starts`."""
    rows = np.flatnonzero(np.isfinite(T_odom_base).all(axis=1))
    table = view.role("initial_pose")
    if table is None:
        return []
    if view.manifest.frames.map:  # nav2 ignores a pose in another frame, too
        table = table.take(table["frame_id"] == view.manifest.frames.map)
    arrived = np.maximum(arrival_ns(view, table["t_log_ns"]), table.t_ns)
    order = np.argsort(arrived, kind="stable")
    yaw = se3.yaw_from_quaternion(table["orientation_xyzw"])
    poses = np.column_stack([table["position_xyz"][:, :2], yaw])
    covs = planar_from_ros(table["covariance"])
    odometry = PoseTrack.without_covariance("odom", "base", t_ns[rows], T_odom_base[rows])
    at_stamp = odometry.at(table.t_ns).xyyaw
    found: dict[int, Start] = {}
    for k in order:
        after = rows[np.searchsorted(t_ns[rows], arrived[k], side="left") :]
        if not len(after) or not np.isfinite(poses[k]).all():
            continue
        moved = se2.between(at_stamp[k], T_odom_base[after[0]])
        pose = se2.compose(poses[k], np.where(np.isfinite(moved), moved, 0.0))
        found[int(after[0])] = Start(int(after[0]), pose, _sound(covs[k]))  # the latest holds
    return [found[row] for row in sorted(found)]


def _sound(cov: se2.Array) -> se2.Array:
    if not np.isfinite(cov).all() or np.linalg.eigvalsh(cov)[0] < 0.0:
        return DEFAULT_COV
    return cov


def _perturbed(start: Start, view: BundleView) -> Start:
    if view.settings.get(GLOBAL):
        return Start(start.row, None, start.cov)
    off = np.array([view.settings.get(name, 0.0) for name in (OFFSET, LEFT, ROTATE)])
    sigma = view.settings.get(SIGMA, 0.0)
    if start.xyyaw is None or not (off.any() or sigma):
        return start
    more = np.diag([sigma**2, sigma**2, min((RAD_PER_M * sigma) ** 2, ANY_ANGLE)])
    return Start(start.row, se2.compose(start.xyyaw, off), start.cov + more)


def _undisturbed(view: BundleView) -> BundleView:
    """The log as it was: odometry that is changed must not move the start as well.

    A view that leaves out all that the localizer said means it.
    """
    if _BELIEVED.isdisjoint(view.tables) or not _says_belief(view):
        return view
    return BundleView(view.bundle, held_out=view.held_out, stretch=view.stretch)


def _says_belief(view: BundleView) -> bool:
    """Whether anything of a localizer is left: poses, or a transform that ends at the map frame."""
    transforms, frame = view.table("transforms"), view.manifest.frames.map
    ends = (transforms["parent_frame"] == frame) | (transforms["child_frame"] == frame)
    return bool(len(view.table("poses")) or ends.any())
