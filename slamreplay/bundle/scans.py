"""Scans as geometry: which beams say something, and where their ends lie about the base."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.no_return import told_as_range_max
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.tables import Ragged
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2, se3


@dataclass(frozen=True, eq=False)
class ScanSet:
    """All scans of the chosen laser, in time order.

    Attributes:
        t_ns: (N,) stamp of the first beam, on the bundle's clock.
        ranges_m: (N, B) float32 as recorded; NaN pads shorter scans.
        angle_min: (N,) bearing of the first beam about the base's z axis in the laser frame, rad.
            Of a laser that is mounted upside down the bearings are mirrored already.
        angle_increment: (N,) rad between beams, signed.
        time_increment_s: (N,) s between beams.
        hits: (N, B) beams with a return inside [range_min, range_max].
        misses: (N, B) beams that saw free space to the end: +inf (REP-117), or what the driver
            writes instead.
        range_max_m: (N,) m.
        xyyaw_base_laser: (3,) the laser's pose on the robot.
        odometry: the motion during a scan, for deskewing; None leaves scans as they are.
    """

    t_ns: NDArray[np.int64]
    ranges_m: NDArray[np.float32]
    angle_min: se2.Array
    angle_increment: se2.Array
    time_increment_s: se2.Array
    hits: NDArray[np.bool_]
    misses: NDArray[np.bool_]
    range_max_m: se2.Array
    xyyaw_base_laser: se2.Array
    odometry: PoseTrack | None

    def __len__(self) -> int:
        return len(self.t_ns)

    def bearings(self, scan: int) -> se2.Array:
        """(B,) angles of the beams in the laser frame, rad."""
        beams = np.arange(self.ranges_m.shape[1])
        return np.asarray(self.angle_min[scan] + beams * self.angle_increment[scan])

    def points(self, scan: int) -> se2.Array:
        """(M, 2) ends of the beams that hit, in the base frame at the scan's stamp, deskewed."""
        hit = self.hits[scan]
        reach = self.ranges_m[scan, hit].astype(np.float64)
        bearing = self.bearings(scan)[hit]
        ends = np.column_stack([reach * np.cos(bearing), reach * np.sin(bearing)])
        ends = se2.transform_points(self.xyyaw_base_laser, ends)
        if self.time_increment_s[scan] <= 0.0 or self.odometry is None or not len(ends):
            return ends
        late_ns = np.flatnonzero(hit) * (self.time_increment_s[scan] * 1e9)
        times = self.t_ns[scan] + np.append(0.0, late_ns).astype(np.int64)
        poses = self.odometry.at(times).xyyaw
        motion = se2.between(poses[:1], poses[1:])
        motion = np.where(np.isfinite(motion), motion, 0.0)  # beyond the odometry: left as it is
        return np.asarray(se2.transform_points(motion, ends[:, None, :])[:, 0, :])


#: Roles of lasers, the one that estimators and tracks go by first.
SCAN_ROLES = ("scan", "scan_2")


def scan_set(view: BundleView) -> ScanSet | None:
    """The scans of the laser that plays the scan role, or None without one.

    A laser whose frame is not in tf is taken to sit at the base's origin; `inspect` says so.
    """
    return _scans_of(view, "scan", odometry_track(view))


def scan_sets(view: BundleView) -> tuple[ScanSet, ...]:
    """The scans of every laser that has a role: that of `scan_set` first, then the others.

    A second laser alone plays no role; a laser whose place on the robot is not in tf cannot be put
    together with another and is left out.
    """
    odometry, base = odometry_track(view), view.manifest.frames.base
    first = _scans_of(view, SCAN_ROLES[0], odometry)
    if first is None:
        return ()
    found = [first]
    for role in SCAN_ROLES[1:]:
        table = view.role(role)
        if table is None or not len(table):
            continue
        laser = str(table["frame_id"][0])
        if not base or not (laser == base or view.transforms.has_path(base, laser)):
            continue
        more = _scans_of(view, role, odometry)
        found += [] if more is None else [more]
    return tuple(found)


@dataclass(frozen=True, eq=False)
class _Returns:
    """What depends on the scans alone, not on where the laser is; attributes as of `ScanSet`."""

    frame_id: str
    t_ns: NDArray[np.int64]
    ranges_m: NDArray[np.float32]
    angle_min: se2.Array
    angle_increment: se2.Array
    time_increment_s: se2.Array
    hits: NDArray[np.bool_]
    misses: NDArray[np.bool_]
    range_max_m: se2.Array


def _scans_of(view: BundleView, role: str, odometry: PoseTrack | None) -> ScanSet | None:
    def decoded(alone: BundleView) -> _Returns | None:
        return _returns(alone, role)

    found = view.shared("scans", ["scans"], decoded, by=role)
    if found is None:
        return None
    mount, upside_down = laser_mount(view, found.frame_id)
    sign = -1.0 if upside_down else 1.0
    return ScanSet(
        found.t_ns,
        found.ranges_m,
        sign * found.angle_min,
        sign * found.angle_increment,
        found.time_increment_s,
        found.hits,
        found.misses,
        found.range_max_m,
        mount,
        odometry,
    )


def _returns(view: BundleView, role: str) -> _Returns | None:
    table = view.role(role)
    if table is None or not len(table):
        return None
    table = table.sorted_by_time()
    matrix = _matrix(table["ranges_m"])
    low, high = table["range_min_m"][:, None], table["range_max_m"][:, None]
    hits, misses = hits_and_misses(matrix, low, high)
    return _Returns(
        str(table["frame_id"][0]),
        table.t_ns,
        matrix,
        table["angle_min_rad"],
        table["angle_increment_rad"],
        table["time_increment_s"],
        hits,
        misses,
        table["range_max_m"],
    )


def _matrix(ranges: Ragged) -> NDArray[np.float32]:
    """(N, B) the rows as a matrix of its own; NaN pads shorter ones."""
    n, width = len(ranges), int(ranges.lengths.max(initial=0))
    if (ranges.lengths == width).all():  # an index of every beam would be four times as large
        first = int(ranges.offsets[0])
        return np.array(ranges.values[first : first + n * width]).reshape(n, width)
    matrix = np.full((n, width), np.nan, dtype=np.float32)
    column = np.arange(len(ranges.values)) - np.repeat(ranges.offsets[:-1], ranges.lengths)
    matrix[np.repeat(np.arange(n), ranges.lengths), column] = ranges.values
    return matrix


def hits_and_misses(
    ranges_m: NDArray[np.float32], range_min_m: se2.Array, range_max_m: se2.Array
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(...) beams with a return in [range_min, range_max], and those that saw free space.

    Args:
        ranges_m: (...) of one laser, all its scans.
        range_min_m: (...) of each range, or what broadcasts to it.
        range_max_m: likewise.
    """
    with np.errstate(invalid="ignore"):
        hits = np.isfinite(ranges_m) & (ranges_m > 0.0)
        hits &= (ranges_m >= range_min_m) & (ranges_m <= range_max_m)
    nothing = told_as_range_max(ranges_m, range_max_m)
    return hits & ~nothing, np.isposinf(ranges_m) | nothing


def laser_mount(view: BundleView, laser: str) -> tuple[se2.Array, bool]:
    """(3,) a laser's pose on the robot, and whether it hangs upside down.

    Upside down it is turned the right way up about its x axis: the bearings change their sign. A
    frame that is not in tf sits at the base's origin.
    """
    T_base_laser = laser_transform(view, laser)
    if T_base_laser is None:
        return np.zeros(3), False
    upside_down = bool(T_base_laser[2, 2] < 0.0)
    if upside_down:
        T_base_laser = T_base_laser @ np.diag([1.0, -1.0, -1.0, 1.0])
    return se3.planar(T_base_laser), upside_down


def laser_transform(view: BundleView, laser: str) -> se2.Array | None:
    """T_base_laser (4, 4), of a moving mount an early one; None of a frame that is not in tf."""
    base = view.manifest.frames.base
    if not base or not view.transforms.has_path(base, laser):
        return None
    moving = [e.t_ns[-1:] for e in view.transforms.path(base, laser) if not e.is_static]
    at = np.min(moving, axis=0) if moving else np.zeros(1, dtype=np.int64)
    return view.transforms.lookup(base, laser, at)[0][0]
