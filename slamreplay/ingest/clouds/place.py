"""Where the sensor of a cloud sits on the robot, and the level frame its scans are told in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se3
from slamreplay.geometry.se2 import Array
from slamreplay.geometry.times import Times
from slamreplay.ingest.names import basename, tokens

#: REP-103: a camera's optical frame looks along z, x to the right; the base along x, z up.
_BASE_OPTICAL = np.array(
    [[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
#: A mount that moves by less than this stays, m and rad.
_FIXED_M, _FIXED_RAD = 0.02, 0.02
#: Of a sensor at an unknown height the band goes as far up as down.
_UNKNOWN_GROUND_M = -0.6
#: The floor lies from so far below to so far above where it is expected (a base frame may be the
#: chassis' middle), and of a sensor that tf does not place so far below it, m.
_AROUND_M, _BELOW_M = (-0.7, 0.15), (-2.0, -0.1)


@dataclass(frozen=True, eq=False)
class Place:
    """A sensor on the robot.

    Attributes:
        frame: the clouds' frame.
        level_frame: the frame of scans: at the sensor, with the base's axes.
        base: the robot's base frame, None where the log has none.
        T_base_sensor: (4, 4) in the middle of the first clouds.
        is_on_tf: whether tf says so; without it the sensor is taken to sit level at the base's
            origin (or to look ahead, where its frame's name says that it is an optical one).
        is_own_frame: rays start at the frame's origin; not of clouds given in the base frame.
        is_fixed: the sensor does not move on the robot.
        ground_z: where the floor lies in the base frame where no cloud shows it, m.
    """

    frame: str
    level_frame: str
    base: str | None
    T_base_sensor: Array
    is_on_tf: bool
    is_own_frame: bool
    is_fixed: bool
    ground_z: float

    @property
    def ground_between(self) -> tuple[float, float]:
        """Heights in the base frame between which the floor must lie, m."""
        if not self.is_on_tf:
            return _BELOW_M
        low, high = _AROUND_M
        sensor_z = float(self.T_base_sensor[2, 3]) if self.is_own_frame else np.inf
        return self.ground_z + low, min(self.ground_z + high, sensor_z - 0.05)

    def at(self, view: BundleView, t_ns: Times) -> Array:
        """(N, 4, 4) T_base_sensor at times (N,); the settled one where tf does not reach."""
        if self.is_fixed or self.base is None:
            return np.broadcast_to(self.T_base_sensor, (len(t_ns), 4, 4)).copy()
        T, valid = view.transforms.lookup(self.base, self.frame, t_ns)
        T[~valid] = self.T_base_sensor
        return T


def place_of(view: BundleView, frame: str, t_ns: Times) -> Place:
    """Where the sensor with that frame sits.

    Args:
        view: the log's transforms and frames.
        frame: of the clouds.
        t_ns: (N,) times of the first clouds, N >= 1.
    """
    base = view.manifest.frames.base
    if base is None or not (frame == base or view.transforms.has_path(base, frame)):
        return _unplaced(frame, base)
    T, valid = view.transforms.lookup(base, frame, t_ns)
    moving = [edge.t_ns for edge in view.transforms.path(base, frame) if not edge.is_static]
    is_fixed = True
    if moving:
        times = np.unique(np.concatenate(moving))
        every, covered = view.transforms.lookup(base, frame, times)
        is_fixed = _stays(every[covered])
        T = T[valid] if valid.any() else every[covered]
    if not len(T):
        return _unplaced(frame, base)
    level = frame
    while frame != base and level in view.transforms.frames():
        level += "_level"
    return Place(
        frame=frame,
        level_frame=level,
        base=base,
        T_base_sensor=T[len(T) // 2],
        is_on_tf=True,
        is_own_frame=frame != base,
        is_fixed=is_fixed,
        ground_z=_ground_z(view, base),
    )


def _unplaced(frame: str, base: str | None) -> Place:
    """A sensor that tf does not place: at the base's origin, as lasers are taken to be."""
    is_optical = "optical" in tokens(basename(frame))
    return Place(
        frame=frame,
        level_frame=frame,
        base=base,
        T_base_sensor=_BASE_OPTICAL if is_optical else np.eye(4),
        is_on_tf=False,
        is_own_frame=True,
        is_fixed=True,
        ground_z=_UNKNOWN_GROUND_M,
    )


def _stays(T: Array) -> bool:
    if not len(T):
        return True
    turned = se3.inverse(T[len(T) // 2]) @ T
    cosine = np.clip((np.trace(turned[:, :3, :3], axis1=1, axis2=2) - 1.0) / 2.0, -1.0, 1.0)
    shift = np.linalg.norm(turned[:, :3, 3], axis=1)
    return bool(np.max(np.arccos(cosine)) <= _FIXED_RAD and np.max(shift) <= _FIXED_M)


def _ground_z(view: BundleView, base: str) -> float:
    """REP-120's base_footprint lies on the floor; a base without one does so itself."""
    for frame in view.transforms.frames():
        if tokens(basename(frame))[-1:] == ["footprint"] and view.transforms.has_path(base, frame):
            T, valid = view.transforms.lookup(base, frame, np.zeros(1, dtype=np.int64))
            return float(T[0, 2, 3]) if valid[0] else 0.0
    return 0.0
