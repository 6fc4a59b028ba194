"""A lidar of many layers in the simulator's worlds, and its clouds as drivers write them.

Walls are what the world's grid has, drawn up to a height; below them lies a floor, above a ceiling.
"""

from dataclasses import dataclass, field

import numpy as np

from slamreplay.geometry import se2, se3
from slamreplay.maps.raycast import cast_rays
from slamreplay.simulate.people import ranges_to

FLOAT32, FLOAT64, UINT32, UINT16, UINT8 = 7, 8, 6, 4, 2
_CODES = {"f4": FLOAT32, "f8": FLOAT64, "u4": UINT32, "u2": UINT16, "u1": UINT8}


def mount(x=0.1, y=-0.05, z=0.55, roll=0.0, pitch=0.0, yaw=0.3):
    """T_base_sensor (4, 4), turned about z, then y, then x."""
    half = np.array([[np.sin(a / 2), np.cos(a / 2)] for a in (roll, pitch, yaw)])
    (sr, cr), (sp, cp), (sy, cy) = half
    quaternion = [
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    ]
    return se3.matrix(np.array([x, y, z]), np.array(quaternion))


@dataclass(frozen=True)
class LayeredLidar:
    """Sixteen layers, two degrees apart, as many columns as a turn of 0.4 degrees a step has."""

    elevations: np.ndarray = field(default_factory=lambda: np.radians(np.arange(-15.0, 16.0, 2.0)))
    azimuths: np.ndarray = field(default_factory=lambda: np.radians(np.arange(0.0, -360.0, -0.4)))
    rate_hz: float = 10.0
    T_base_sensor: np.ndarray = field(default_factory=mount)
    wall_m: float = 2.0
    ceiling_m: float = 2.6
    range_max_m: float = 60.0
    sigma_m: float = 0.0

    @property
    def directions(self):
        """(R, C, 3) unit vectors in the sensor's frame."""
        elevation, azimuth = np.meshgrid(self.elevations, self.azimuths, indexing="ij")
        flat = np.cos(elevation)
        return np.stack(
            [flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=-1
        )

    @property
    def sweep_s(self):
        """(C,) time of each column after the first."""
        turned = np.abs(self.azimuths - self.azimuths[0])
        return turned / (2.0 * np.pi) / self.rate_hz

    def sweeps(self, grid, poses_at, t_s, rng=None, walkers=()):
        """(N, R, C, 3) points in the sensor's frame of sweeps that begin at `t_s`; NaN for none."""
        n, (rings, columns) = len(t_s), self.directions.shape[:2]
        at = (t_s[:, None] + self.sweep_s).ravel()
        base = poses_at(at)
        R, origin = self.T_base_sensor[:3, :3], self.T_base_sensor[:3, 3]
        sensor = se2.compose(base, np.array([origin[0], origin[1], 0.0]))
        points = np.empty((n, rings, columns, 3), dtype=np.float32)
        for ring, own in enumerate(self.directions):
            ray = own @ R.T
            flat = np.hypot(ray[:, 0], ray[:, 1])
            bearing = np.tile(np.arctan2(ray[:, 1], ray[:, 0]), n)
            slope = np.tile(ray[:, 2] / flat, n)
            rays = sensor.copy()
            rays[:, 2] += bearing
            wall = cast_rays(grid, rays, np.zeros(1), self.range_max_m)[:, 0]
            if walkers:
                wall = np.minimum(wall, ranges_to(walkers, at, rays))
            with np.errstate(divide="ignore", invalid="ignore"):
                floor = np.where(slope < 0.0, -origin[2] / np.minimum(slope, -1e-9), np.inf)
                ceiling = np.where(
                    slope > 0.0, (self.ceiling_m - origin[2]) / np.maximum(slope, 1e-9), np.inf
                )
                over = origin[2] + wall * slope > self.wall_m
            met = np.minimum(np.where(over, np.inf, wall), np.minimum(floor, ceiling))
            reach = met / np.tile(flat, n)
            if rng is not None and self.sigma_m:
                reach = reach + self.sigma_m * rng.standard_normal(len(reach))
            reach = np.where(reach <= self.range_max_m, reach, np.nan)
            points[:, ring] = reach.reshape(n, columns, 1) * own[None]
        return points


@dataclass(frozen=True)
class DepthCamera(LayeredLidar):
    """A pinhole camera, 86 degrees wide: its frame looks along z, x to the right.

    All its pixels are of one moment.
    """

    T_base_sensor: np.ndarray = field(
        default_factory=lambda: mount(0.25, 0.0, 0.35, yaw=0.0) @ OPTICAL
    )
    range_max_m: float = 8.0
    pixels: tuple[int, int] = (80, 60)

    @property
    def directions(self):
        wide, high = self.pixels
        right, down = np.meshgrid(np.linspace(-0.93, 0.93, wide), np.linspace(-0.7, 0.7, high))
        ray = np.stack([right, down, np.ones_like(right)], axis=-1)
        return ray / np.linalg.norm(ray, axis=-1, keepdims=True)

    @property
    def sweep_s(self):
        return np.zeros(self.pixels[0])


#: T_base_camera of a camera's optical frame (REP-103).
OPTICAL = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


def cloud_message(
    make, header, points, late_s=None, *, time=None, big=False, pad=0, first=(), kind="f4"
):
    """A PointCloud2.

    Args:
        make: makes a message of a type from its fields.
        header: of the message.
        points: (R, C, 3) or (M, 3) in the sensor's frame, NaN for none.
        late_s: (R, C) or (M,) times of points after the stamp.
        time: name, dtype and function of `late_s` of the time field; None for none.
        big: big-endian.
        pad: bytes after each row.
        first: (name, dtype) of fields before x.
        kind: dtype of x, y and z.
    """
    rows = points if points.ndim == 3 else points[None]
    order = ">" if big else "<"
    fields = [*first, *((name, kind) for name in "xyz"), *([time[:2]] if time else [])]
    layout = np.dtype([(name, order + form) for name, form in fields])
    cells = np.zeros(rows.shape[:2], dtype=layout)
    for axis, name in enumerate("xyz"):
        cells[name] = rows[..., axis]
    if time:
        cells[time[0]] = time[2](np.broadcast_to(late_s, rows.shape[:2]))
    raw = cells.view(np.uint8).reshape(rows.shape[0], rows.shape[1] * layout.itemsize)
    raw = np.pad(raw, [(0, 0), (0, pad)])
    described = [
        make("sensor_msgs/PointField", name=name, offset=layout.fields[name][1],
             datatype=_CODES[form], count=1)
        for name, form in fields
    ]  # fmt: skip
    return make(
        "sensor_msgs/PointCloud2",
        header=header,
        height=rows.shape[0],
        width=rows.shape[1],
        fields=described,
        is_bigendian=big,
        point_step=layout.itemsize,
        row_step=raw.shape[1],
        data=raw.ravel(),
        is_dense=bool(np.isfinite(rows).all()),
    )


FRAME, TOPIC = "lidar", "/points"
VELODYNE_TIME = ("time", "f4", lambda late_s: late_s)


def cloud_records(recording, messages, lidar, *, time=VELODYNE_TIME, laser_too=False, **layout):
    """A recording's messages with clouds of a layered lidar in place of its laser's scans."""
    from slamreplay.simulate.topics import START_NS, Record, records

    r = recording
    rng = np.random.default_rng(r.seed)
    late_s = np.broadcast_to(lidar.sweep_s, lidar.directions.shape[:2])
    t_s = r.scans.t_s[r.scans.t_s + 1.0 / lidar.rate_hz < r.motion.t_s[-1]]
    kept = [x for x in records(r, messages) if laser_too or x.msgtype != "sensor_msgs/LaserScan"]
    kept.append(_mount(messages, lidar, START_NS))
    for first in range(0, len(t_s), 50):
        part = t_s[first : first + 50]
        walkers = r.scenario.walkers
        for at, points in zip(
            part, lidar.sweeps(r.standing, r.motion.poses_at, part, rng, walkers), strict=True
        ):
            stamp = START_NS + round(float(at) * 1e9)
            header = messages.header(stamp, FRAME)
            cloud = cloud_message(messages.make, header, points, late_s, time=time, **layout)
            arrival = stamp + round(1e9 / lidar.rate_hz) + 4_000_000
            kept.append(Record(arrival, TOPIC, "sensor_msgs/PointCloud2", cloud))
    return sorted(kept, key=lambda record: record.t_log_ns)


def _mount(m, lidar, t_ns):
    from slamreplay.simulate.topics import Record

    T = lidar.T_base_sensor
    x, y, z = T[:3, 3]
    turned = m.make(
        "geometry_msgs/Transform",
        translation=m.vector(x, y, z),
        rotation=m.make(
            "geometry_msgs/Quaternion", **dict(zip("xyzw", _quaternion(T), strict=True))
        ),
    )
    edge = m.make(
        "geometry_msgs/TransformStamped",
        header=m.header(t_ns, "base_link"),
        child_frame_id=FRAME,
        transform=turned,
    )
    message = m.make("tf2_msgs/TFMessage", transforms=[edge])
    return Record(t_ns + 5_000_000, "/tf_static", "tf2_msgs/TFMessage", message)


def _quaternion(T):
    """(4,) floats xyzw of a rotation; by its largest component (Shepperd, 1978)."""
    R = T[:3, :3]
    four = np.array([R[0, 0], R[1, 1], R[2, 2], np.trace(R)])
    k = int(np.argmax(four))
    q = np.empty(4)
    if k == 3:
        q[:] = [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], 1.0 + four[3]]
    else:
        i, j = (k + 1) % 3, (k + 2) % 3
        q[k] = 1.0 - four[3] + 2.0 * R[k, k]
        q[i], q[j], q[3] = R[i, k] + R[k, i], R[j, k] + R[k, j], R[j, i] - R[i, j]
        q[3] = R[j, i] - R[i, j]
    return [float(v) for v in q / np.linalg.norm(q)]
