"""What a recorder on the robot would have written: every message of a recording in log order."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from slamreplay.geometry import se2, se3
from slamreplay.geometry.times import NS_PER_S
from slamreplay.simulate.behavior import status_changes
from slamreplay.simulate.codes import camera_mount
from slamreplay.simulate.costmap import RESOLUTION_M, local_costmap
from slamreplay.simulate.drive import RATE_HZ, Follow, Phase
from slamreplay.simulate.localizer import odometry_at
from slamreplay.simulate.messages import Messages
from slamreplay.simulate.recording import Recording
from slamreplay.simulate.scenarios import START_NS as START_NS  # where others look for it
from slamreplay.simulate.sensors import XYYAW_BASE_LASER, XYYAW_BASE_REAR, Lidar, Scans

#: nav2_amcl dates map->odom ahead, so that it can be used until the next one comes.
TRANSFORM_TOLERANCE_NS = NS_PER_S
LASER_HEIGHT_M = 0.22
#: Seconds from an event to its place in the log.
_ODOMETRY_LATE, _IMU_LATE, _SCAN_LATE, _AMCL_LATE, _REST_LATE = 0.002, 0.001, 0.004, 0.012, 0.003
_CODE_LATE = 0.03
_CAMERA = "floor_camera"
_JITTER_S = 0.0008
#: Topics whose last message is kept for late subscribers.
LATCHED = frozenset({"/map", "/tf_static"})


@dataclass(frozen=True)
class Record:
    """One message on its way into a log: `msgtype` is "package/Name"."""

    t_log_ns: int
    topic: str
    msgtype: str
    message: Any


def records(recording: Recording, messages: Messages) -> list[Record]:
    """All messages of a recording, sorted by log time."""
    writers = (_start, _wheels, _inertial, _lidar, _codes, _navigator, _costmaps, _reference)
    found = [r for write in writers for r in write(recording, messages)]
    jitter = np.random.Generator(np.random.PCG64([recording.seed, 1]))
    delays = (_JITTER_S * 1e9 * jitter.exponential(size=len(found))).astype(np.int64).tolist()
    late = [
        Record(r.t_log_ns + d, r.topic, r.msgtype, r.message)
        for r, d in zip(found, delays, strict=True)
    ]
    return sorted(late, key=lambda r: r.t_log_ns)


def _ns(r: Recording, t_s: float) -> int:
    """A time since the start as a stamp."""
    return r.scenario.start_ns + round(float(t_s) * NS_PER_S)


def _start(r: Recording, m: Messages) -> Iterator[Record]:
    for laser in _lasers(r):
        mount = m.transform(_ns(r, 0), ("base_link", laser.frame), laser.mount, LASER_HEIGHT_M)
        yield Record(_ns(r, 0.005), "/tf_static", "tf2_msgs/TFMessage", mount)
    known = r.logged_map
    grid = m.grid(_ns(r, 0), "map", known.cells, known.resolution_m, known.origin_xyyaw)
    yield Record(_ns(r, 0.005), "/map", "nav_msgs/OccupancyGrid", grid)
    clicked = m.pose_stamped_with_covariance(_ns(r, 0.02), r.start, r.scenario.start_cov)
    yield Record(
        _ns(r, 0.02 + _REST_LATE),
        "/initialpose",
        "geometry_msgs/PoseWithCovarianceStamped",
        clicked,
    )


def _wheels(r: Recording, m: Messages) -> Iterator[Record]:
    frames = ("odom", "base_link")
    twist_cov = np.diag([4e-4, 1e-6, 4e-4])
    o = r.odometry
    late_s = r.scenario.odometry_late_s
    if "odometry" in r.scenario.without:
        return
    for t_s, xyyaw, cov, twist in zip(o.t_s, o.xyyaw, o.cov, o.twist, strict=True):
        stamp, arrival = _ns(r, t_s + late_s), _ns(r, t_s + _ODOMETRY_LATE)
        message = m.odometry(stamp, frames, xyyaw, cov, twist, twist_cov)
        yield Record(arrival, "/odom", "nav_msgs/Odometry", message)
        if "tf" not in r.scenario.without:
            yield Record(arrival, "/tf", "tf2_msgs/TFMessage", m.transform(stamp, frames, xyyaw))


def _inertial(r: Recording, m: Messages) -> Iterator[Record]:
    unknown = np.zeros(9)
    unknown[0] = -1.0  # sensor_msgs/Imu: there is no orientation
    gyro_cov, force_cov = np.eye(3).ravel() * 0.003**2, np.eye(3).ravel() * 0.04**2
    nowhere = m.make("geometry_msgs/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    for t_s, gyro, force in zip(r.motion.t_s, r.gyro, r.force, strict=True):
        message = m.make(
            "sensor_msgs/Imu",
            header=m.header(_ns(r, t_s), "base_link"),
            orientation=nowhere,
            orientation_covariance=unknown,
            angular_velocity=m.vector(*gyro),
            angular_velocity_covariance=gyro_cov,
            linear_acceleration=m.vector(*force),
            linear_acceleration_covariance=force_cov,
        )
        yield Record(_ns(r, t_s + _IMU_LATE), "/imu", "sensor_msgs/Imu", message)


@dataclass(frozen=True, eq=False)
class _Laser:
    """One laser of the robot: where its scans go and where it sits."""

    topic: str
    frame: str
    mount: se2.Array
    lidar: Lidar
    scans: Scans


def _lasers(r: Recording) -> tuple[_Laser, ...]:
    lidar, rear = r.scenario.lidar, r.scenario.rear
    if "laser" in r.scenario.without:
        return ()
    if rear is None or r.rear is None:
        return (_Laser("/scan", "laser", XYYAW_BASE_LASER, lidar, r.scans),)
    return (
        _Laser("/scan_front", "laser_front", XYYAW_BASE_LASER, lidar, r.scans),
        _Laser("/scan_rear", "laser_rear", XYYAW_BASE_REAR, rear, r.rear),
    )


def _lidar(r: Recording, m: Messages) -> Iterator[Record]:
    """Scans, and what the localizer makes of each as soon as it is there."""
    if not _lasers(r):
        return
    front, *others = _lasers(r)
    b = r.beliefs
    has_odometry = "odometry" not in r.scenario.without
    bases = odometry_at(r.odometry, _stamps(r) - r.scenario.odometry_late_s)
    for i, t_s in enumerate(front.scans.t_s):
        stamp, arrival_s = _ns(r, t_s + r.scenario.scan_late_s), t_s + _arrival_s(front)
        yield _scan(r, m, front, i)
        answer = _ns(r, arrival_s + _AMCL_LATE)
        if b.updated[i] or not has_odometry:
            # Nothing carries a pose on where there is no odometry: such localizers send them all.
            mean = b.mean[i] if has_odometry else se2.compose(b.map_odom[i], bases[i])
            pose = m.pose_stamped_with_covariance(stamp, mean, b.cov[i])
            yield Record(answer, "/amcl_pose", "geometry_msgs/PoseWithCovarianceStamped", pose)
        if has_odometry and "tf" not in r.scenario.without:
            frames = ("map", "odom")
            correction = m.transform(stamp + TRANSFORM_TOLERANCE_NS, frames, b.map_odom[i])
            yield Record(answer, "/tf", "tf2_msgs/TFMessage", correction)
    for laser in others:
        for i in range(len(laser.scans.t_s)):
            yield _scan(r, m, laser, i)


def _stamps(r: Recording) -> se2.Array:
    """(N,) what the stamps of the first laser's scans say, s since the start."""
    return r.scans.t_s + r.scenario.scan_late_s


def _arrival_s(laser: _Laser) -> float:
    return laser.lidar.time_increment_s * (laser.lidar.beams - 1) + _SCAN_LATE


def _scan(r: Recording, m: Messages, laser: _Laser, i: int) -> Record:
    lidar, t_s = laser.lidar, laser.scans.t_s[i]
    bearings = lidar.bearings
    message = m.make(
        "sensor_msgs/LaserScan",
        header=m.header(_ns(r, t_s + r.scenario.scan_late_s), laser.frame),
        angle_min=float(bearings[0]),
        angle_max=float(bearings[-1]),
        angle_increment=float(bearings[1] - bearings[0]),
        time_increment=lidar.time_increment_s,
        scan_time=1.0 / lidar.rate_hz,
        range_min=lidar.range_min_m,
        range_max=lidar.range_max_m,
        ranges=laser.scans.ranges[i],
        intensities=np.empty(0, dtype=np.float32),
    )
    return Record(_ns(r, t_s + _arrival_s(laser)), laser.topic, "sensor_msgs/LaserScan", message)


def _codes(r: Recording, m: Messages) -> Iterator[Record]:
    """Readings of codes in the floor, and on /tf_static where camera and codes are."""
    floor, readings = r.scenario.floor, r.readings
    if floor is None or readings is None:
        return
    mount = m.spatial_transforms(_ns(r, 0), "base_link", [_CAMERA], camera_mount()[None])
    yield Record(_ns(r, 0.005), "/tf_static", "tf2_msgs/TFMessage", mount)
    names = [f"tag_{number}" for number in range(len(floor.places))]
    survey = m.spatial_transforms(_ns(r, 0), "map", names, se3.from_planar(floor.places))
    yield Record(_ns(r, 0.006), "/tf_static", "tf2_msgs/TFMessage", survey)
    for t_s, number, T in zip(readings.t_s, readings.number, readings.T_camera_code, strict=True):
        stamp = _ns(r, t_s)
        found = m.code(stamp, _CAMERA, int(number), floor.size_m, T)
        array = m.make(
            "apriltag_ros/AprilTagDetectionArray",
            header=m.header(stamp, _CAMERA),
            detections=[found],
        )
        msgtype = "apriltag_ros/AprilTagDetectionArray"
        yield Record(_ns(r, t_s + _CODE_LATE), "/tag_detections", msgtype, array)


def _navigator(r: Recording, m: Messages) -> Iterator[Record]:
    for first in range(0, len(r.motion.t_s), RATE_HZ // 10):
        v, w = r.motion.wheels[first]
        t_s = max(r.motion.t_s[first] - 0.02, 0.0)  # the wheels follow a moment later
        yield Record(_ns(r, t_s), "/cmd_vel", "geometry_msgs/Twist", m.twist(float(v), float(w)))
    for phase in r.motion.phases:
        if isinstance(phase.step, Follow):
            t_s = phase.first / RATE_HZ
            plan = m.path(_ns(r, t_s), _believed_plan(r, phase))
            yield Record(_ns(r, t_s + 0.06 + _REST_LATE), "/plan", "nav_msgs/Path", plan)
    for change in status_changes(r.motion):
        status = m.make(
            "nav2_msgs/BehaviorTreeStatusChange",
            timestamp=m.stamp(_ns(r, change.t_s)),
            node_name=change.node,
            uid=change.uid,
            previous_status=change.before,
            current_status=change.after,
        )
        log = m.make(
            "nav2_msgs/BehaviorTreeLog", timestamp=m.stamp(_ns(r, change.t_s)), event_log=[status]
        )
        yield Record(
            _ns(r, change.t_s + _REST_LATE), "/behavior_tree_log", "nav2_msgs/BehaviorTreeLog", log
        )


def _believed_plan(r: Recording, phase: Phase) -> se2.Array:
    """The path as the robot has it on its map: moved by the error of its belief at that time."""
    assert isinstance(phase.step, Follow)
    corners = np.vstack([phase.path, *(np.array(phase.step.beyond).reshape(-1, 2),)])
    arcs = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    at = np.arange(0.0, arcs[-1], 0.25)
    points = np.column_stack([np.interp(at, arcs, corners[:, i]) for i in (0, 1)])
    points = np.vstack([points, corners[-1]])
    yaw = np.arctan2(*np.diff(points, axis=0).T[::-1])
    true = np.column_stack([points, np.append(yaw, yaw[-1])])
    if not len(r.scans.t_s):
        return true
    t_s = np.array([phase.first / RATE_HZ])
    scan = max(int(np.searchsorted(r.scans.t_s, t_s[0])) - 1, 0)
    believed = se2.compose(r.beliefs.map_odom[scan], odometry_at(r.odometry, t_s)[0])
    error = se2.compose(believed, se2.inverse(r.motion.poses_at(t_s)[0]))
    return se2.compose(error, true)


def _costmaps(r: Recording, m: Messages) -> Iterator[Record]:
    if "odometry" in r.scenario.without:
        return
    base = odometry_at(r.odometry, r.scans.t_s)
    every = round(r.scenario.lidar.rate_hz)
    for i in range(0, len(r.scans.t_s), every):
        ranges = r.scans.ranges[i].astype(np.float64)
        costs, origin = local_costmap(base[i], r.scenario.lidar.bearings, ranges)
        pose = np.array([*origin, 0.0])
        t_s = r.scans.t_s[i] + 0.1
        message = m.grid(_ns(r, t_s), "odom", costs, RESOLUTION_M, pose)
        topic = "/local_costmap/costmap"
        yield Record(_ns(r, t_s + _REST_LATE), topic, "nav_msgs/OccupancyGrid", message)


def _reference(r: Recording, m: Messages) -> Iterator[Record]:
    none, frames = np.zeros((3, 3)), ("map", "base_link")
    t_s = np.arange(0.0, r.motion.t_s[-1], 0.05)
    poses = r.motion.poses_at(t_s)
    twists = r.motion.twist[np.rint(t_s * RATE_HZ).astype(np.int64)]
    for t, xyyaw, twist in zip(t_s, poses, twists, strict=True):
        message = m.odometry(_ns(r, t), frames, xyyaw, none, twist, none)
        yield Record(_ns(r, t + _IMU_LATE), "/slamreplay/reference", "nav_msgs/Odometry", message)
