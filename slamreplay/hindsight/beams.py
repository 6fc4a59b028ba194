"""All scans as beams about the robot: where each one ended, deskewed, in arrays for the kernels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.bundle.scans import ScanSet
from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2
from slamreplay.matching.threads import share_out

INVALID, HIT, MISS = 0, 1, 2
#: A beam without a return proves free space no farther than this, whatever the driver claims.
MAX_REACH_M = 30.0
#: Nearer returns come from the robot itself more often than not.
MIN_RANGE_M = 0.15
#: Scans of two lasers further apart than this are not laid side by side.
PAIRED_NS = 150_000_000
#: So many scans are worth a thread of their own.
_WORTH_A_THREAD = 200


@dataclass(frozen=True, eq=False)
class Beams:
    """Beams of N scans, B per scan.

    Attributes:
        t_ns: (N,) scan times.
        ends: (N, B, 2) float32 ends in the base frame at the scan's stamp, m; of a miss the point
            up to which it saw free space.
        kind: (N, B) int8 INVALID, HIT or MISS.
        laser_xy: (2,) where the beams start, in the base frame.
    """

    t_ns: NDArray[np.int64]
    ends: NDArray[np.float32]
    kind: NDArray[np.int8]
    laser_xy: se2.Array

    def __len__(self) -> int:
        return len(self.t_ns)

    def take(self, scans: NDArray[np.int64]) -> Beams:
        """Some of the scans, by index."""
        return Beams(self.t_ns[scans], self.ends[scans], self.kind[scans], self.laser_xy)

    def points(self, scan: int) -> se2.Array:
        """(M, 2) ends of the beams that hit something."""
        return self.ends[scan, self.kind[scan] == HIT].astype(np.float64)


def beams_of(scans: ScanSet, motion: PoseTrack | None) -> Beams:
    """Every beam of a scan set; a scan's own motion, as a track has it, is taken out linearly.

    Args:
        scans: of one laser.
        motion: the base in a frame that does not jump; None leaves scans as they are.
    """
    n, width = scans.ranges_m.shape
    kind = np.where(scans.hits, HIT, np.where(scans.misses, MISS, INVALID)).astype(np.int8)
    limit = np.minimum(np.nan_to_num(scans.range_max_m, nan=0.0), MAX_REACH_M)
    reach = np.where(kind == MISS, limit[:, None], scans.ranges_m).astype(np.float32)
    kind[~(reach >= MIN_RANGE_M)] = INVALID
    kind[~np.isfinite(scans.angle_min + scans.angle_increment)] = INVALID
    mount = scans.xyyaw_base_laser
    ends = np.zeros((n, width, 2), dtype=np.float32)
    during = np.zeros((n, 3))
    sweep_s = scans.time_increment_s * (width - 1)
    if motion is not None and width > 1 and (sweep_s > 0.0).any():
        late_ns = np.where(sweep_s > 0.0, sweep_s * 1e9, 0.0).astype(np.int64)
        during = se2.between(motion.at(scans.t_ns).xyyaw, motion.at(scans.t_ns + late_ns).xyyaw)
        during = np.where(np.isfinite(during), during, 0.0)  # beyond the track: left as it is
    every_scan = (reach, kind, scans.angle_min, scans.angle_increment, during, ends)

    def work(first: int, stop: int) -> None:
        _lay_out(mount, *(values[first:stop] for values in every_scan))

    share_out(n, work, _WORTH_A_THREAD)
    return Beams(scans.t_ns, ends, kind, mount[:2].copy())


@njit(cache=True, nogil=True)
def _lay_out(mount, reach, kind, angle_min, angle_increment, during, ends):  # type: ignore[no-untyped-def]
    """Ends of the valid beams about the base at the stamp, each after its part of the motion."""
    count, width = reach.shape
    for s in range(count):
        for b in range(width):
            if kind[s, b] == INVALID:
                continue
            bearing = mount[2] + angle_min[s] + b * angle_increment[s]
            x = mount[0] + reach[s, b] * np.cos(bearing)
            y = mount[1] + reach[s, b] * np.sin(bearing)
            if during[s, 0] != 0.0 or during[s, 1] != 0.0 or during[s, 2] != 0.0:
                part = b / (width - 1)
                cos, sin = np.cos(part * during[s, 2]), np.sin(part * during[s, 2])
                x, y = cos * x - sin * y, sin * x + cos * y
                x += part * during[s, 0]
                y += part * during[s, 1]
            ends[s, b, 0], ends[s, b, 1] = x, y


def side_by_side(first: Beams, second: Beams, motion: PoseTrack | None) -> Beams:
    """Each scan of the first laser with the nearest in time of the second, for matching.

    The second's points are brought into the base frame at the first's stamp. Rays still start at
    the first laser: for what they passed through, use `interleaved`.
    """
    after = np.clip(np.searchsorted(second.t_ns, first.t_ns), 1, max(len(second) - 1, 1))
    after = np.minimum(after, len(second) - 1)
    before = np.maximum(after - 1, 0)
    apart = np.abs(second.t_ns[[before, after]] - first.t_ns)
    nearest = np.where(apart[0] <= apart[1], before, after)
    ends, kind = second.ends[nearest].copy(), second.kind[nearest].copy()
    kind[apart.min(axis=0) > PAIRED_NS] = INVALID
    if motion is not None:
        moved = se2.between(motion.at(first.t_ns).xyyaw, motion.at(second.t_ns[nearest]).xyyaw)
        _move(ends, np.where(np.isfinite(moved), moved, 0.0)[:, None, :])
    return Beams(
        first.t_ns,
        np.concatenate([first.ends, ends], axis=1),
        np.concatenate([first.kind, kind], axis=1),
        first.laser_xy,
    )


def interleaved(
    first: Beams, second: Beams, poses: se2.Array, motion: PoseTrack | None
) -> tuple[Beams, se2.Array, NDArray[np.bool_]]:
    """The scans of both lasers in time order, their poses, and which are the first's.

    All rays shall start at one point of the robot, so the second laser's scans get a base of their
    own, shifted so that its laser lies where the first's does. They follow `motion` from the
    nearest scan of the first that has a pose; without that the scan's own pose holds.

    Args:
        first: N scans.
        second: M scans.
        poses: (N, 3) of the first's, NaN where there is none.
        motion: the base in a frame that does not jump.
    """
    after = np.clip(np.searchsorted(first.t_ns, second.t_ns), 0, len(first) - 1)
    before = np.maximum(after - 1, 0)
    apart = np.abs(first.t_ns[[before, after]] - second.t_ns)
    nearest = np.where(apart[0] <= apart[1], before, after)
    way = np.zeros((len(second), 3))
    if motion is not None:
        way = se2.between(motion.at(first.t_ns[nearest]).xyyaw, motion.at(second.t_ns).xyyaw)
        way = np.where(np.isfinite(way), way, 0.0)
    shift = second.laser_xy - first.laser_xy
    theirs = se2.compose(poses[nearest], se2.compose(way, np.append(shift, 0.0)))
    theirs[apart.min(axis=0) > PAIRED_NS] = np.nan
    width = max(first.kind.shape[1], second.kind.shape[1])
    ends = np.concatenate([_wide(first.ends, width), _wide(second.ends - shift, width)])
    kind = np.concatenate([_wide(first.kind, width), _wide(second.kind, width)])
    t_ns = np.concatenate([first.t_ns, second.t_ns])
    order = np.argsort(t_ns, kind="stable")
    both = Beams(t_ns[order], ends[order].astype(np.float32), kind[order], first.laser_xy)
    return both, np.concatenate([poses, theirs])[order], order < len(first)


def _wide(values: NDArray, width: int) -> NDArray:
    """Padded with zeros (INVALID) to `width` beams."""
    rest = [(0, 0)] * (values.ndim - 2)
    return np.pad(values, [(0, 0), (0, width - values.shape[1]), *rest])


def _move(ends: NDArray[np.float32], motion: se2.Array) -> None:
    """Bring ends (N, B, 2) seen after motions (N, 1 or B, 3) into the frame before them."""
    cos, sin = np.cos(motion[..., 2]), np.sin(motion[..., 2])
    x, y = ends[..., 0].copy(), ends[..., 1].copy()
    ends[..., 0] = motion[..., 0] + cos * x - sin * y
    ends[..., 1] = motion[..., 1] + sin * x + cos * y
