"""The messages of the chosen inputs as measurements of the state, in the order of their times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import BundleView
from slamreplay.estimators.ekf.node.parameters import PLANAR, Input, NodeParameters
from slamreplay.geometry import se2, se3
from slamreplay.geometry.covariance import planar_from_ros, ros_turned
from slamreplay.geometry.times import NS_PER_S, Times

#: In which tables the messages of an input are.
_TABLES = {"odom": ("odometry", "references"), "pose": ("poses", "references", "initial_poses"),
           "twist": ("velocities",), "imu": ("imu",)}  # fmt: skip
#: What a part of a message measures, as places in the state.
_POSE, _TWIST, _ACCELERATION = np.array([0, 1, 2]), np.array([3, 4, 5]), np.array([6, 7])
#: An axis is taken in where a turn puts this much of a chosen one into it (as the node decides).
_SOME = 1e-6


@dataclass(frozen=True, eq=False)
class Part:
    """K measurements by one part of an input's messages.

    Attributes:
        source: input and part: "odom0 twist".
        topic: of the messages.
        is_pose: whether it is about the pose, in the world's axes; else in the base's.
        t_ns: (K,) when.
        z: (K, 8) values, zero where not measured.
        R: (K, 8, 8) their covariance.
        used: (K, 8) which are measured.
        lever: (K, 2) where in the base velocities were measured, m.
        threshold: largest Mahalanobis distance; infinite for any.
    """

    source: str
    topic: str
    is_pose: bool
    t_ns: Times
    z: se2.Array
    R: se2.Array
    used: NDArray[np.bool_]
    lever: se2.Array
    threshold: float

    def __len__(self) -> int:
        return len(self.t_ns)


def parts_of(view: BundleView, parameters: NodeParameters) -> tuple[list[Part], dict[str, int]]:
    """All parts of all inputs, and by input how many messages the log has.

    Messages are read as they were recorded, placeholders included, for so the node reads them; of
    references only those that the robot sensed. One whose frame tf does not lead to the world's or
    the base's is left out, as are values that are not finite.
    """
    parts, messages = [], {}
    for one in parameters.inputs:
        table = _rows(view, one)
        messages[one.name] = 0 if table is None else len(table)
        if table is not None and len(table):
            found = _imu(view, parameters, one, table) if one.kind == "imu" else (
                _odometry(view, parameters, one, table))  # fmt: skip
            parts += [part for part in found if len(part)]
    return parts, messages


def _rows(view: BundleView, one: Input) -> Table | None:
    for name in _TABLES[one.kind]:
        table = view.recorded(name)
        mine = np.char.lstrip(table["topic"].astype(str), "/") == one.topic.lstrip("/")
        if mine.any():
            return table.take(mine).sorted_by_time()
    return None


def _odometry(view: BundleView, parameters: NodeParameters, one: Input, table: Table) -> list[Part]:
    """Pose and velocity of odom, pose or twist messages."""
    parts = []
    names = {column.name for column in table.schema.columns}
    base = _base(view, parameters)
    if "position_xyz" in names and one.kind != "twist":
        T = se3.matrix(table["position_xyz"], table["orientation_xyzw"])
        covariance = table["pose_covariance" if "pose_covariance" in names else "covariance"]
        parts += _pose(view, parameters, one, table, T, covariance, f"{one.name} pose")
    if "twist_covariance" in names:
        frame = "child_frame_id" if "child_frame_id" in names else "frame_id"
        T_base_sensor = _transforms(view, base, table[frame], table.t_ns)
        values = np.column_stack([table["linear_velocity_xyz"], table["angular_velocity_xyz"]])
        covariance = table["twist_covariance"].reshape(-1, 6, 6)
        parts.append(
            _velocity(f"{one.name} twist", one, table.t_ns, values, covariance, T_base_sensor,
                      np.array(one.config[6:12]))
        )  # fmt: skip
    return parts


def _pose(
    view: BundleView,
    parameters: NodeParameters,
    one: Input,
    table: Table,
    T: se2.Array,
    covariance: se2.Array,
    source: str,
) -> list[Part]:
    """Poses (K, 4, 4) in their own frames: absolute, relative, or as velocities between them."""
    config = np.array(one.config[:6])
    if not config.any():
        return []
    covariance = covariance.reshape(-1, 6, 6)
    sound = np.isfinite(T[:, :3, 3]).all(axis=1)
    T = np.where(np.isfinite(T), T, np.eye(4))  # a position without a heading
    if one.differential:  # a way between two poses needs no frame
        return [_between(one, source, table.t_ns[sound], T[sound], covariance[sound], config)]
    T_world = _transforms(view, parameters.world_frame, table["frame_id"], table.t_ns)
    if one.relative and sound.any():
        T = se3.inverse(T[np.argmax(sound)]) @ T
    z = se3.planar(T_world @ T)
    turned = _turned(covariance, T_world[:, :3, :3])
    used = np.column_stack([
        _reached(T_world[:, :3, :3], config[:3])[:, :2],
        _reached(T_world[:, :3, :3], config[3:])[:, 2:],
    ])  # fmt: skip
    if "orientation_xyzw" in {c.name for c in table.schema.columns}:
        used[:, 2] &= np.isfinite(table["orientation_xyzw"]).all(axis=1)
    return [_part(source, one, _POSE, table.t_ns, z, planar_from_ros(turned), used,
                  one.pose_threshold)]  # fmt: skip


def _between(
    one: Input,
    source: str,
    t_ns: Times,
    T: se2.Array,
    covariance: se2.Array,
    config: NDArray[np.bool_],
) -> Part:
    """Poses as the velocities from one to the next.

    Their covariance is what the node makes it (RosFilter::preparePose): the sum of both poses',
    times the seconds between them, although that of a difference divided by dt has 1 / dt^2.
    """
    dt = np.diff(t_ns) / NS_PER_S
    later = np.flatnonzero(dt > 0.0)
    dt = dt[later, None]
    z = se3.planar(se3.inverse(T[later]) @ T[later + 1]) / dt
    both = planar_from_ros(covariance[later] + covariance[later + 1]) * dt[:, :, None]
    used = np.broadcast_to(config[[0, 1, 5]], z.shape)
    source = f"{source} differences"
    return _part(source, one, _TWIST, t_ns[later + 1], z, both, used, one.pose_threshold)


def _velocity(
    source: str,
    one: Input,
    t_ns: Times,
    values: se2.Array,
    covariance: se2.Array,
    T_base_sensor: se2.Array,
    config: NDArray[np.bool_],
) -> Part:
    """Velocities (K, 6) of a sensor, linear and angular, brought into the base.

    What its place adds to them in a turn is taken off where they are held against the state.
    """
    R = T_base_sensor[:, :3, :3]
    values = np.where(config | np.isfinite(values), values, 0.0)
    linear = (R @ values[:, :3, None])[..., 0]
    angular = (R @ values[:, 3:, None])[..., 0]
    z = np.column_stack([linear[:, :2], angular[:, 2]])
    used = np.column_stack([_reached(R, config[:3])[:, :2], _reached(R, config[3:])[:, 2:]])
    turned = planar_from_ros(_turned(covariance, R))
    return _part(source, one, _TWIST, t_ns, z, turned, used, one.twist_threshold,
                 T_base_sensor[:, :2, 3])  # fmt: skip


def _imu(view: BundleView, parameters: NodeParameters, one: Input, table: Table) -> list[Part]:
    """Heading, turn rate and accelerations of an inertial unit."""
    T = _transforms(view, _base(view, parameters), table["frame_id"], table.t_ns)
    R, parts, t_ns = T[:, :3, :3], [], table.t_ns
    if any(one.config[3:6]):
        parts.append(_heading(one, table, R))
    if any(one.config[9:12]):
        zero, cov = np.zeros((len(table), 3)), np.zeros((len(table), 6, 6))
        cov[:, 3:, 3:] = table["angular_velocity_covariance"].reshape(-1, 3, 3)
        values = np.column_stack([zero, table["angular_velocity_xyz"]])
        config = np.array([False] * 3 + list(one.config[9:12]))
        parts.append(_velocity(f"{one.name} turn rate", one, t_ns, values, cov, T, config))
    if any(one.config[12:15]):
        felt = table["linear_acceleration_xyz"]
        if one.without_gravity:
            world = se3.rotation_matrix(table["orientation_xyzw"])
            world = np.where(np.isfinite(world), world, R)  # level where it tells no attitude
            felt = felt - parameters.gravity * world[:, 2, :]
        cov = np.zeros((len(table), 6, 6))
        cov[:, :3, :3] = table["linear_acceleration_covariance"].reshape(-1, 3, 3)
        turned = _turned(cov, R)[:, :2, :2]
        used = _reached(R, np.array(one.config[12:15]))[:, :2]
        z = (R @ felt[:, :, None])[:, :2, 0]
        parts.append(_part(f"{one.name} acceleration", one, _ACCELERATION, t_ns, z, turned, used,
                           one.acceleration_threshold))  # fmt: skip
    return parts


def _heading(one: Input, table: Table, R: se2.Array) -> Part:
    """The unit's yaw in its own world less that of its mount, absolute, relative or as a rate."""
    yaw = se3.yaw_from_quaternion(table["orientation_xyzw"]) - np.arctan2(R[:, 1, 0], R[:, 0, 0])
    variance = table["orientation_covariance"].reshape(-1, 3, 3)[:, 2, 2]
    t_ns, source = table.t_ns, f"{one.name} orientation"
    sound = np.flatnonzero(np.isfinite(yaw))
    if one.differential:
        dt = np.diff(t_ns[sound]) / NS_PER_S
        later = np.flatnonzero(dt > 0.0)
        before, after = sound[later], sound[later + 1]
        rate = se2.wrap_angle(yaw[after] - yaw[before]) / dt[later]
        both = (variance[after] + variance[before]) * dt[later]
        t_ns, yaw, variance, source = t_ns[after], rate, both, f"{source} differences"
    elif one.relative and len(sound):
        yaw = se2.wrap_angle(yaw - yaw[sound[0]])
    z, cov = np.zeros((len(yaw), 3)), np.zeros((len(yaw), 3, 3))
    z[:, 2], cov[:, 2, 2] = yaw, variance
    used = np.zeros((len(yaw), 3), dtype=bool)
    used[:, 2] = one.config[5]
    where = _TWIST if one.differential else _POSE
    return _part(source, one, where, t_ns, z, cov, used, one.pose_threshold)


def _part(
    source: str,
    one: Input,
    where: NDArray[np.int64],
    t_ns: Times,
    z: se2.Array,
    covariance: se2.Array,
    used: NDArray[np.bool_],
    threshold: float | None,
    lever: se2.Array | None = None,
) -> Part:
    """A part of those rows that measure anything, at their places in the state."""
    variance = np.diagonal(covariance, axis1=1, axis2=2)
    used = used & np.isfinite(z) & np.isfinite(variance)
    keep = np.flatnonzero(used.any(axis=1))
    n, size = len(keep), len(PLANAR)
    all_z, all_R = np.zeros((n, size)), np.zeros((n, size, size))
    all_used = np.zeros((n, size), dtype=bool)
    all_z[:, where] = np.where(used[keep], z[keep], 0.0)
    all_R[:, where[:, None], where] = np.nan_to_num(covariance[keep])
    all_used[:, where] = used[keep]
    place = np.zeros((n, 2)) if lever is None else lever[keep]
    limit = np.inf if threshold is None else threshold
    is_pose = bool(where[0] == 0)
    return Part(source, one.topic, is_pose, t_ns[keep], all_z, all_R, all_used, place, limit)


def _transforms(
    view: BundleView, target: str, frames: NDArray[np.object_], t_ns: Times
) -> se2.Array:
    """(K, 4, 4) each row's frame in the target, NaN where tf does not tell; an empty one is it."""
    out = np.full((len(t_ns), 4, 4), np.nan)
    for frame in sorted(set(frames)):
        rows = np.flatnonzero(frames == frame)
        if frame in ("", target):
            out[rows] = np.eye(4)
        elif view.transforms.has_path(target, frame):
            T, valid = view.transforms.lookup(target, frame, t_ns[rows])
            out[rows[valid]] = T[valid]
    return out


def _turned(covariance: se2.Array, R: se2.Array) -> se2.Array:
    """(K, 6, 6) covariances about other axes, each by its own R (K, 3, 3); NaN where R is."""
    out = np.full(covariance.shape, np.nan)
    known = np.isfinite(R).all(axis=(1, 2))
    same = known & (np.abs(R - np.eye(3)).max(axis=(1, 2)) < _SOME)
    out[same] = covariance[same]
    for k in np.flatnonzero(known & ~same).tolist():
        out[k] = ros_turned(covariance[k], R[k])
    return out


def _reached(R: se2.Array, config: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(K, 3) which axes the chosen ones reach, turned by R (K, 3, 3); none where R is NaN."""
    size = np.sqrt(np.sum((R * config) ** 2, axis=2))
    return np.asarray(size >= _SOME)


def _base(view: BundleView, parameters: NodeParameters) -> str:
    return parameters.base_frame or view.manifest.frames.base or "base_link"
