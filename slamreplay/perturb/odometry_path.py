"""The path that odometry tells, changed on tf and on the topic alike."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.geometry import se2, se3
from slamreplay.geometry.se2 import Array
from slamreplay.geometry.times import Times
from slamreplay.geometry.transforms import Edge
from slamreplay.perturb.odometry_rows import odometry_rows
from slamreplay.perturb.tf_delay import moving_odometry

#: Times (N,) and poses (N, 3) that odometry tells, sorted, to the poses that it is to tell.
Change = Callable[[Times, Array], Array]
#: Times (N,), velocities (N, 3) in m/s and turn rates (N, 3) in rad/s to those it is to tell.
Twists = Callable[[Times, Array, Array], tuple[Array, Array]]

_POSE = ("position_xyz", "orientation_xyzw")
_TRANSFORM = ("translation_xyz", "rotation_xyzw")


@dataclass(frozen=True, eq=False)
class Told:
    """Where a log tells odometry; rows are sorted by time.

    Attributes:
        topic: rows of table `odometry`, of the topic that plays the role.
        tf: rows of table `transforms`, of the edge that carries the motion.
        is_upside_down: whether that edge has odometry below the base.
    """

    topic: NDArray[np.int64]
    tf: NDArray[np.int64]
    is_upside_down: bool


def told_odometry(view: BundleView, name: str) -> Told:
    """The rows that tell odometry, on tf, on a topic, or on both.

    Of several moving transforms in a row (a base that also pitches) the one that drives farthest
    carries the motion.

    Args:
        view: the log.
        name: of the perturbation that asks.

    Raises:
        NotApplicableError: the log has none, or tf leads from odometry to the base by way of a
            third frame, about which both move.
    """
    rows, transforms = odometry_rows(view, name), view.table("transforms")
    topic = _sorted(view.table("odometry"), rows["odometry"])
    if not rows["transforms"].any():
        return Told(topic, np.zeros(0, dtype=np.int64), is_upside_down=False)
    moving, below = moving_odometry(view, name), _below_odometry(view)
    sides = {edge.child in below for edge in moving}
    if len(sides) > 1:
        what = "tf has no straight way from odometry to the base: both move about a third frame"
        raise NotApplicableError(what, where=name)
    edge = max(moving, key=_length)
    own = (transforms["parent_frame"] == edge.parent) & (transforms["child_frame"] == edge.child)
    return Told(topic, _sorted(transforms, own), is_upside_down=not sides.pop())


def with_odometry(
    view: BundleView, name: str, change: Change, twists: Twists | None = None
) -> BundleView:
    """The view with another path, wherever the log tells it; height, roll and pitch stay.

    Args:
        view: the log.
        name: of the perturbation that asks.
        change: of the path; it is asked once for tf and once for the topic, whose rows come at
            other times, so that what it does should depend on times and not on rows.
        twists: what becomes of the velocities on the topic; None leaves them.

    Raises:
        NotApplicableError: as of `told_odometry`.
    """
    told = told_odometry(view, name)
    if len(told.topic):
        table = _changed(view.table("odometry"), told.topic, change, _POSE, is_inverse=False)
        if twists is not None:
            table = _with_twists(table, told.topic, twists)
        view = view.with_table(table)
    if len(told.tf):
        transforms = view.table("transforms")
        view = view.with_table(
            _changed(transforms, told.tf, change, _TRANSFORM, is_inverse=told.is_upside_down)
        )
    return view


def retold(xyyaw: Array, distance_ratio: Array | float, turn: Array) -> Array:
    """The path anew from its first pose on, of steps as long and turns as large as they are told.

    Args:
        xyyaw: (N, 3) path.
        distance_ratio: (N - 1,) of each step's length to what it was, or one for all.
        turn: (N - 1,) rad from each pose to the next.
    """
    if not len(xyyaw):
        return xyyaw
    step = turns_of(xyyaw)
    yaw = xyyaw[0, 2] + np.append(0.0, np.cumsum(turn))
    # A step is a chord: it lies in the middle between the headings at its ends.
    off = yaw[:-1] + 0.5 * turn - (xyyaw[:-1, 2] + 0.5 * step[:, 2])
    cos, sin = distance_ratio * np.cos(off), distance_ratio * np.sin(off)
    x = xyyaw[0, 0] + np.append(0.0, np.cumsum(cos * step[:, 0] - sin * step[:, 1]))
    y = xyyaw[0, 1] + np.append(0.0, np.cumsum(sin * step[:, 0] + cos * step[:, 1]))
    return np.column_stack([x, y, yaw])


def turns_of(xyyaw: Array) -> Array:
    """(N - 1, 3) differences of a path (N, 3) along its own axes, the turns on the shorter way."""
    step = np.diff(xyyaw, axis=0)
    step[:, 2] = se2.wrap_angle(step[:, 2])
    return step


def _sorted(table: Table, mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    rows = np.flatnonzero(mask)
    return rows[np.argsort(table.t_ns[rows], kind="stable")]


def _below_odometry(view: BundleView) -> set[str]:
    """Frames from the base up to the odometry's, its own left out; all up to the root."""
    found, frame = set(), view.manifest.frames.base or ""
    while frame != view.manifest.frames.odom:
        found.add(frame)
        if frame not in view.transforms.edges:
            break
        frame = view.transforms.edges[frame].parent
    return found


def _length(edge: Edge) -> float:
    step = np.diff(edge.translation_xyz[:, :2], axis=0)
    return float(np.nansum(np.hypot(step[:, 0], step[:, 1])))


def _changed(
    table: Table,
    rows: NDArray[np.int64],
    change: Change,
    names: tuple[str, str],
    *,
    is_inverse: bool,
) -> Table:
    position, quaternion = table[names[0]].copy(), table[names[1]].copy()
    T = se3.matrix(position[rows], quaternion[rows])
    T = se3.inverse(T) if is_inverse else T
    xyyaw = se3.planar(T)
    known = np.isfinite(xyyaw).all(axis=1)
    rows, T, xyyaw = rows[known], T[known], xyyaw[known]
    after = np.asarray(change(table.t_ns[rows], xyyaw.copy()))
    turn = se2.wrap_angle(after[:, 2] - xyyaw[:, 2])
    if is_inverse:
        R = se3.from_planar(np.column_stack([np.zeros((len(turn), 2)), turn]))[:, :3, :3]
        xyz = np.column_stack([after[:, :2], T[:, 2, 3]])
        T = se3.inverse(se3.from_parts(R @ T[:, :3, :3], xyz))
        position[rows], quaternion[rows] = T[:, :3, 3], se3.quaternion(T[:, :3, :3])
    else:
        position[rows, :2] = after[:, :2]
        quaternion[rows] = se3.yawed(quaternion[rows], turn)
    return table.replace(**{names[0]: position, names[1]: quaternion})


def _with_twists(table: Table, rows: NDArray[np.int64], twists: Twists) -> Table:
    linear, angular = table["linear_velocity_xyz"].copy(), table["angular_velocity_xyz"].copy()
    linear[rows], angular[rows] = twists(table.t_ns[rows], linear[rows], angular[rows])
    return table.replace(linear_velocity_xyz=linear, angular_velocity_xyz=angular)
