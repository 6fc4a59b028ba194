"""A bundle made in memory: a robot drives round a small room, and everything about it is known.

One module, longer than most: a recipe read from top to bottom, a function for each table.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Clock, FrameEdge, Frames, Manifest, MapVersion, Missing, Role
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import Bundle
from slamreplay.geometry import se2, se3
from slamreplay.geometry.covariance import ros_from_planar
from slamreplay.geometry.times import ns
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.raycast import cast_rays
from slamreplay.testing.synthetic_rows import (
    LATENCY_NS,
    START_NS,
    ns_of,
    pose_columns,
    table_of,
    tf_rows,
)

__all__ = [
    "LATENCY_NS",
    "MOUNT_XYYAW",
    "RANGE_MAX_M",
    "START_NS",
    "TAGS_XYYAW",
    "imu_rows",
    "odometry_rows",
    "pose_rows",
    "room_grid",
    "scan_rows",
    "sighting_rows",
    "survey_rows",
    "synthetic_bundle",
    "synthetic_manifest",
    "true_path",
    "unit_on_its_back",
]

#: The laser on the robot; neither straight nor central, so that a forgotten mount shows.
MOUNT_XYYAW = np.array([0.15, 0.02, 0.05])
RANGE_MAX_M = 10.0
#: Tags x, y, yaw in the frame of the room; the last two are reflectors: points without heading.
TAGS_XYYAW = np.array(
    [[0.2, 4.0, 0.0], [6.0, 8.6, -1.6], [11.7, 5.5, 3.0], [5.0, 0.3, 1.5], [9.0, 8.7, np.nan],
     [0.3, 6.5, np.nan]]
)  # fmt: skip
_SEEN_M, _SEEN_RAD = 7.0, 1.0
_BEAMS = 181
_SPEED_M_S = 0.5


def room_grid() -> OccupancyGrid:
    """A room of 12 x 9 m at 5 cm without symmetry; its grid lies turned in the map frame."""
    cells = np.zeros((180, 240), dtype=np.int8)
    cells[[0, 1, -2, -1]] = 100
    cells[:, [0, 1, -2, -1]] = 100
    cells[80:100, 100:140] = 100  # an island inside the path
    cells[150:178, 20:30] = 100  # corners that differ from each other
    cells[2:14, 200:238] = 100
    cells[160:170, 150:190] = 100
    return OccupancyGrid(cells, 0.05, np.array([-2.0, 1.0, 0.1]))


def true_path(t_s: NDArray[np.float64]) -> se2.Array:
    """(N, 3) where the robot is at times (N,): round an ellipse at 0.5 m/s, in the map frame."""
    angle = np.linspace(0.0, 40.0 * np.pi, 40_001)
    x, y = 6.0 + 3.8 * np.cos(angle), 4.5 + 2.4 * np.sin(angle)
    travelled = np.append(0.0, np.cumsum(np.hypot(np.diff(x), np.diff(y))))
    at = np.interp(np.asarray(t_s) * _SPEED_M_S, travelled, angle)
    heading = np.arctan2(2.4 * np.cos(at), -3.8 * np.sin(at))
    in_room = np.column_stack([6.0 + 3.8 * np.cos(at), 4.5 + 2.4 * np.sin(at), heading])
    return se2.compose(room_grid().origin_xyyaw, in_room)


def synthetic_bundle(
    *,
    seconds: float = 20.0,
    seed: int = 0,
    world: OccupancyGrid | None = None,
    with_map: bool = True,
    with_initial_pose: bool = True,
    with_belief: bool = True,
    belief_offset_xyyaw: Sequence[float] = (0.0, 0.0, 0.0),
    offset_from_s: float = 0.0,
    with_tags: bool = False,
    with_imu: bool = False,
) -> Bundle:
    """A bundle in memory, with scans, odometry, tf, map, belief, initial pose and reference.

    Args:
        seconds: length of the log; scans come at 10 Hz, odometry at 20 Hz, the belief at 2 Hz.
        seed: of the noise: 1 cm on ranges, 1 % and a slow drift on odometry.
        world: what the laser sees; None means the room as mapped. Edit `room_grid().cells` for an
            aisle that changed.
        with_map: whether the log holds the map.
        with_initial_pose: whether somebody set the pose at the start.
        with_belief: whether a localizer's pose and map->odom were recorded.
        belief_offset_xyyaw: how far that belief is from the truth (in the robot's frame),
        offset_from_s: from then on, in seconds after the start.
        with_tags: whether the robot sees tags that static transforms tie to the map, at 4 Hz.
        with_imu: whether it has an inertial unit at 50 Hz, which a static transform places upside
            down.
    """
    rng = np.random.Generator(np.random.PCG64(seed))
    options = (seconds, seed, with_map, with_initial_pose, with_belief, with_tags)
    offset = tuple(float(v) for v in belief_offset_xyyaw)
    seen = room_grid() if world is None else world
    identity = repr((*options, offset, offset_from_s, seen.version)) + " imu" * with_imu

    scan_s = np.arange(0.0, seconds, 0.1)
    odometry_s = np.arange(0.0, seconds + 0.05, 0.05)
    belief_s = np.arange(0.0, seconds, 0.5)
    T_odom_base = _drifting(true_path(odometry_s), rng)
    at_belief = se2.interpolate(ns_of(odometry_s), T_odom_base, ns_of(belief_s))
    off = np.where((belief_s >= offset_from_s)[:, None], np.asarray(offset), 0.0)
    noise = rng.normal(0.0, [0.01, 0.01, 0.003], (len(belief_s), 3))
    T_map_base = se2.compose(true_path(belief_s), off + noise)

    tables = {
        "scans": scan_rows(scan_s, true_path(scan_s), seen, rng),
        "odometry": odometry_rows(odometry_s, T_odom_base),
        "references": pose_rows("references", "/truth", odometry_s, true_path(odometry_s), 1e-6),
    }
    transforms = [
        tf_rows("odom", "base_link", odometry_s, T_odom_base),
        tf_rows("base_link", "laser", np.zeros(1), MOUNT_XYYAW[None], is_static=True),
    ]
    if with_belief:
        T_map_odom = se2.compose(T_map_base, se2.inverse(at_belief))
        transforms.append(tf_rows("map", "odom", belief_s, T_map_odom, ahead_s=0.1))
        tables["poses"] = pose_rows("poses", "/amcl_pose", belief_s, T_map_base, 1e-3)
    if with_initial_pose:
        start = se2.compose(true_path(np.zeros(1)), np.array([0.1, -0.1, 0.05]))
        tables["initial_poses"] = pose_rows(
            "initial_poses", "/initialpose", np.zeros(1), start, 0.05
        )
    if with_tags:
        # Its own generator: whether tags are seen leaves all other noise as it is.
        tag_s, own = np.arange(0.0, seconds, 0.25), np.random.Generator(np.random.PCG64([seed, 1]))
        tags = sighting_rows(tag_s, true_path(tag_s), _tag_noise, own)
        tables["references"] = Table.concat(TABLES["references"], [tables["references"], tags])
        transforms += survey_rows()
    if with_imu:
        own = np.random.Generator(np.random.PCG64([seed, 2]))
        tables["imu"] = imu_rows(np.arange(0.0, seconds, 0.02), own)
        transforms.append(unit_on_its_back())
    tables["transforms"] = Table.concat(TABLES["transforms"], transforms)
    grids = {room_grid().version: room_grid()} if with_map else {}
    manifest = synthetic_manifest(tables, identity, seconds, with_map, with_belief)
    return Bundle(manifest, tables, grids)


def synthetic_manifest(
    tables: dict[str, Table], identity: str, seconds: float, with_map: bool, with_belief: bool
) -> Manifest:
    """What the bundle says of itself; `identity` makes its id."""
    roles = {"scans": "scan", "odometry": "odometry", "references": "reference"}
    optional = {"initial_poses": "initial_pose", "imu": "imu"}
    roles |= {name: role for name, role in optional.items() if name in tables}
    found = [(role, str(tables[name]["topic"][0])) for name, role in roles.items()]
    if with_belief:
        found += [("pose", "/amcl_pose"), ("covariance", "/amcl_pose")]
    lacking = ["costmap", "recovery"] if "imu" in tables else ["imu", "costmap", "recovery"]
    lacking += [] if with_belief else ["pose", "covariance"]
    lacking += [] if with_map else ["map"]
    tf = tables["transforms"]
    pairs = sorted(set(zip(tf["parent_frame"], tf["child_frame"], tf["is_static"], strict=True)))
    tree = [
        FrameEdge(
            parent=parent,
            child=child,
            is_static=bool(static),
            samples=int(((tf["parent_frame"] == parent) & (tf["child_frame"] == child)).sum()),
        )
        for parent, child, static in pairs
    ]
    grid = room_grid()
    version = MapVersion(
        version=grid.version,
        folder=grid.version.removeprefix("sha256:")[:16],
        source="synthetic room",
        width=grid.cells.shape[1],
        height=grid.cells.shape[0],
        resolution_m=grid.resolution_m,
    )
    return Manifest(
        bundle_id=hashlib.sha256(identity.encode()).hexdigest()[:16],
        sources=[],
        options={},
        start_ns=START_NS,
        end_ns=START_NS + ns(seconds),
        clock=Clock(name="sensor", reason="synthetic", knots=[(START_NS + LATENCY_NS, START_NS)]),
        frames=Frames(map="map" if with_belief else None, odom="odom", base="base_link", tree=tree),
        roles=[
            Role(role=role, topic=topic, type="synthetic", messages=0, reason="the only one")
            for role, topic in found
        ],
        missing=[Missing(part=part, reason="not made", consequence="none") for part in lacking],
        maps=[version] if with_map else [],
        losses=[],
        tables={},
    )


def _drifting(xyyaw: se2.Array, rng: np.random.Generator) -> se2.Array:
    """(N, 3) what wheels make of a path (N, 3): increments with noise, from the odometry's zero."""
    steps = se2.between(xyyaw[:-1], xyyaw[1:])
    length = np.linalg.norm(steps[:, :2], axis=1, keepdims=True)
    noise = rng.standard_normal(steps.shape) * np.array([0.02, 0.005, 0.02]) * np.sqrt(length)
    steps = steps * np.array([1.01, 1.0, 0.99]) + noise
    out = np.zeros_like(xyyaw)
    for k, step in enumerate(steps):
        out[k + 1] = se2.compose(out[k], step)
    return out


def scan_rows(
    t_s: NDArray[np.float64], where: se2.Array, world: OccupancyGrid, rng: np.random.Generator
) -> Table:
    """What a laser sees of a world from poses (N, 3) of the base, with 1 cm of noise."""
    angle_min, step = -2.2, 4.4 / (_BEAMS - 1)
    laser = se2.compose(where, MOUNT_XYYAW)
    ranges = cast_rays(
        world, laser, angle_min + step * np.arange(_BEAMS, dtype=np.float64), RANGE_MAX_M
    )
    ranges = ranges + rng.normal(0.0, 0.01, ranges.shape)
    return table_of(
        "scans",
        "/scan",
        t_s,
        frame_id="laser",
        angle_min_rad=angle_min,
        angle_increment_rad=step,
        time_increment_s=0.0,
        scan_time_s=0.1,
        range_min_m=0.05,
        range_max_m=RANGE_MAX_M,
        ranges_m=list(ranges),
    )


def survey_rows() -> list[Table]:
    """Static transforms from the map to the tags."""
    places = se2.compose(room_grid().origin_xyyaw, np.nan_to_num(TAGS_XYYAW))
    return [
        tf_rows("map", f"tag_{k}", np.zeros(1), place[None], is_static=True)
        for k, place in enumerate(places)
    ]


def _tag_noise(reach: NDArray[np.float64]) -> se2.Array:
    """2 cm, 0.01 rad, and headings 0.03 rad."""
    return np.tile([0.02, 0.01, 0.03], (len(reach), 1))


def sighting_rows(
    t_s: NDArray[np.float64],
    where: se2.Array,
    sigma: Callable[[NDArray[np.float64]], se2.Array],
    rng: np.random.Generator,
) -> Table:
    """What a camera in the base's origin sees of the tags.

    Args:
        t_s: (N,) when it looks, s.
        where: (N, 3) the base then.
        sigma: of range m, bearing rad and heading rad (M, 3) by range (M,).
        rng: of the noise.
    """
    there = se2.compose(room_grid().origin_xyyaw, TAGS_XYYAW)
    seen = se2.between(where[:, None], there[None])
    reach, bearing = np.hypot(seen[..., 0], seen[..., 1]), np.arctan2(seen[..., 1], seen[..., 0])
    row, tag = np.nonzero((reach < _SEEN_M) & (np.abs(bearing) < _SEEN_RAD))
    noise = rng.normal(0.0, 1.0, (len(row), 3)) * sigma(reach[row, tag])
    reach, bearing = reach[row, tag] + noise[:, 0], bearing[row, tag] + noise[:, 1]
    xyyaw = np.column_stack(
        [reach * np.cos(bearing), reach * np.sin(bearing), seen[row, tag, 2] + noise[:, 2]]
    )
    return table_of(
        "references",
        "/tags",
        t_s[row],
        kind="fiducial",
        frame_id="base_link",
        child_frame_id=[f"tag_{k}" for k in tag],
        covariance=np.full((len(row), 36), np.nan),
        **pose_columns(xyyaw),
    )


def odometry_rows(t_s: NDArray[np.float64], xyyaw: se2.Array) -> Table:
    """The topic of odometry at 20 Hz, of poses (N, 3) in its own frame."""
    speed = np.linalg.norm(np.gradient(xyyaw[:, :2], 0.05, axis=0), axis=1)
    turn = np.gradient(np.unwrap(xyyaw[:, 2]), 0.05)
    zero = np.zeros_like(speed)
    return table_of(
        "odometry",
        "/odom",
        t_s,
        frame_id="odom",
        child_frame_id="base_link",
        **pose_columns(xyyaw),
        pose_covariance=np.full((len(t_s), 36), np.nan),
        linear_velocity_xyz=np.column_stack([speed, zero, zero]),
        angular_velocity_xyz=np.column_stack([zero, zero, turn]),
        twist_covariance=np.full((len(t_s), 36), np.nan),
    )


def imu_rows(t_s: NDArray[np.float64], rng: np.random.Generator) -> Table:
    """What an inertial unit measures at times (N,) that lies on its back: its z axis points down.

    Rates scatter by 0.005 rad/s; its orientation tells the heading to 0.002 rad.
    """
    yaw = np.unwrap(true_path(t_s)[:, 2])
    rate = np.gradient(yaw, t_s) + 0.005 * rng.standard_normal(len(t_s))
    scattered = yaw + 0.002 * rng.standard_normal(len(t_s))
    zero, felt = np.zeros(len(t_s)), -9.81 + 0.02 * rng.standard_normal(len(t_s))
    upright = se3.quaternion_from_rpy(zero + np.pi, zero, zero)
    unknown = np.full((len(t_s), 9), np.nan)
    return table_of(
        "imu",
        "/imu",
        t_s,
        frame_id="imu",
        orientation_xyzw=se3.yawed(upright, scattered),
        orientation_covariance=unknown,
        angular_velocity_xyz=np.column_stack([zero, zero, -rate]),
        angular_velocity_covariance=unknown,
        linear_acceleration_xyz=np.column_stack([zero, zero, felt]),
        linear_acceleration_covariance=unknown,
    )


def unit_on_its_back() -> Table:
    """The static transform that places it."""
    flat = tf_rows("base_link", "imu", np.zeros(1), np.zeros((1, 3)), is_static=True)
    return flat.replace(rotation_xyzw=np.array([[1.0, 0.0, 0.0, 0.0]]))


def pose_rows(
    name: str, topic: str, t_s: NDArray[np.float64], xyyaw: se2.Array, variance: float
) -> Table:
    """Poses (N, 3) in the map as a table of that name: variance m^2, a quarter of it rad^2."""
    extra = {
        "references": {"kind": "simulation", "child_frame_id": "base_link"},
        "poses": {"source": topic, "child_frame_id": "base_link"},
        "initial_poses": {},
    }[name]
    # One and the same covariance throughout would be a placeholder, not an estimate.
    breathing = 1.0 + 1e-6 * np.sin(np.arange(len(t_s)))
    cov = breathing[:, None, None] * np.diag([variance, variance, variance / 4])
    return table_of(
        name,
        topic,
        t_s,
        frame_id="map",
        covariance=ros_from_planar(cov),
        **pose_columns(xyyaw),
        **extra,
    )
