"""Sightings of things with a surveyed place, as ranges, bearings and headings with their noise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.sightings import Sightings
from slamreplay.bundle.track import PoseTrack
from slamreplay.estimators.ekf import kernels
from slamreplay.estimators.ekf.kernels import NEAREST_M
from slamreplay.estimators.ekf.noise import Noise
from slamreplay.geometry import se2

#: Nothing is measured better than this, whatever a log states: 1 mm, 1 mrad.
_FINEST = np.diag([1e-6, 1e-6, 1e-6])
#: Things nearer than this are held against x and y, m.
NEAR_M = 0.5
#: A range is never taken to lack more than all but this share of it.
_LEAST = 0.2


@dataclass(frozen=True, eq=False)
class Observations:
    """M sightings of T things, in order of time.

    Attributes:
        t_ns: (M,) when.
        kind: (M,) fiducial or dock.
        thing: (M,) which one, 0 to T - 1.
        places: (T, 3) of the things in the map, m, m, rad; NaN where a heading is not surveyed.
        sensed: (M, 3) range m, bearing rad, heading rad in the base, as sensed.
        dims: (M,) 3 where the heading was sensed and is surveyed, else 2.
        stated: (M, 3, 3) covariance of `sensed` that the log states, NaN where it does not.
        names: (T,) of the things.
        unsurveyed: sightings of things without a survey, which are left out.
        repeated: sightings of a thing without any motion since the last one, left out too.
    """

    t_ns: NDArray[np.int64]
    kind: NDArray[np.object_]
    thing: NDArray[np.int64]
    places: se2.Array
    sensed: se2.Array
    dims: NDArray[np.int64]
    stated: se2.Array
    unsurveyed: int
    names: NDArray[np.str_]
    repeated: int = 0

    @classmethod
    def none(cls) -> Observations:
        """Of nothing."""
        no, pose, cov = np.empty(0, dtype=np.int64), np.empty((0, 3)), np.empty((0, 3, 3))
        kind, names = np.empty(0, dtype=object), np.empty(0, dtype="U1")
        return cls(no, kind, no, pose, pose, no, cov, 0, names)

    def __len__(self) -> int:
        return len(self.t_ns)

    def take(self, index: NDArray[np.int64] | NDArray[np.bool_]) -> Self:
        """Those at an index array or under a mask; the things stay the same."""
        parts = ("t_ns", "kind", "thing", "sensed", "dims", "stated")
        return replace(self, **{name: getattr(self, name)[index] for name in parts})

    def of_moving(self, odometry: PoseTrack, least_m: float, least_rad: float) -> Self:
        """Without sightings of a thing from the very pose from which it was seen last.

        A camera at rest sees the same pixels: what it gets wrong it gets wrong again, and a
        hundred looks tell no more than one (nav2_amcl waits for motion, too).

        Args:
            odometry: base in odom.
            least_m: a thing counts again after driving this far,
            least_rad: or turning by this much.
        """
        keep = after_motion(self.t_ns, self.thing, len(self.places), odometry, least_m, least_rad)
        return replace(self.take(keep), repeated=int((~keep).sum()))

    def corrected(self, noise: Noise) -> se2.Array:
        """(M, 3) `sensed` without its constant errors."""
        out = self.sensed.copy()
        out[:, 1] = se2.wrap_angle(out[:, 1] - noise.bearing_offset_rad)
        out[:, 0] = (out[:, 0] - noise.range_offset_m) / self.stretch(noise)
        out[:, 0] = np.maximum(out[:, 0], NEAREST_M)
        return out

    @property
    def is_near(self) -> NDArray[np.bool_]:
        """(M,) whether a thing is so near that it is held against x and y, not range and bearing.

        Errors of a bearing are Gaussian where the thing is many of its widths away; over a code in
        the floor a bearing is anything.
        """
        return np.asarray(self.sensed[:, 0] < NEAR_M)

    @staticmethod
    def in_base(sensed: se2.Array, R: se2.Array) -> tuple[se2.Array, se2.Array]:
        """x, y, heading (M, 3) in the base, and their covariances, of those R (M, 3, 3) of it."""
        return cartesian(sensed, R)

    def stretch(self, noise: Noise) -> se2.Array:
        """(M,) by how much the ranges are measured too long, as a ratio: their constant errors."""
        bearing = self.sensed[:, 1] - noise.bearing_offset_rad
        beside = se2.wrap_angle(bearing - noise.range_axis_rad)
        return noise.range_ratio * np.maximum(1.0 - noise.range_falloff * beside**2, _LEAST)

    def covariance(self, noise: Noise, scale: float = 1.0) -> se2.Array:
        """(M, 3, 3) of `sensed`, without lasting errors: the log's own, else from the settings.

        Args:
            noise: the settings.
            scale: ratio by which all variances are multiplied.
        """
        R = np.zeros((len(self), 3, 3))
        R[:, 0, 0] = noise.range_m**2 + (noise.range_per_m * self.sensed[:, 0]) ** 2
        # No bearing to a near thing is told better across than that of one at the end of near.
        across = NEAR_M / np.clip(self.sensed[:, 0], NEAREST_M, NEAR_M)
        R[:, 1, 1], R[:, 2, 2] = (across * noise.bearing_rad) ** 2, noise.heading_rad**2
        told = np.isfinite(self.stated[:, :2, :2]).all(axis=(1, 2))
        R[told, :2, :2] = noise.stated_ratio**2 * self.stated[told, :2, :2]
        told = np.isfinite(self.stated[:, 2, 2])
        R[told, 2, 2] = noise.stated_ratio**2 * self.stated[told, 2, 2]
        return scale * (R + _FINEST)


def cartesian(polar: se2.Array, R: se2.Array) -> tuple[se2.Array, se2.Array]:
    """x, y, heading (M, 3) and their covariances (M, 3, 3) of range, bearing, heading (M, 3)."""
    reach, bearing = polar[:, 0], polar[:, 1]
    cos, sin = np.cos(bearing), np.sin(bearing)
    J = np.zeros((len(polar), 3, 3))
    J[:, 0, 0], J[:, 0, 1] = cos, -reach * sin
    J[:, 1, 0], J[:, 1, 1] = sin, reach * cos
    J[:, 2, 2] = 1.0
    seen = np.column_stack([reach * cos, reach * sin, polar[:, 2]])
    return seen, J @ R @ np.swapaxes(J, 1, 2)


def base_by(seen: se2.Array, R: se2.Array, places: se2.Array) -> tuple[se2.Array, se2.Array]:
    """The base in the map (M, 3), by things at known poses, and its covariances (M, 3, 3).

    What is measured is then the state itself, and no linearisation stands between them, however far
    off the state is: after a way without sightings one of them is enough.

    Args:
        seen: (M, 3) x, y, heading of the things in the base.
        R: (M, 3, 3) of them.
        places: (M, 3) the things in the map.
    """
    pose = se2.compose(places, se2.inverse(seen))
    cos, sin = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    away = places - pose
    J = np.zeros((len(seen), 3, 3))
    J[:, 0, 0], J[:, 0, 1], J[:, 0, 2] = -cos, sin, -away[:, 1]
    J[:, 1, 0], J[:, 1, 1], J[:, 1, 2] = -sin, -cos, away[:, 0]
    J[:, 2, 2] = -1.0
    return pose, J @ R @ np.swapaxes(J, 1, 2)


def after_motion(
    t_ns: NDArray[np.int64],
    thing: NDArray[np.int64],
    count: int,
    odometry: PoseTrack,
    least_m: float,
    least_rad: float,
) -> NDArray[np.bool_]:
    """(M,) which measurements come after some motion since the last one of the same thing.

    Args:
        t_ns: (M,) when, sorted.
        thing: (M,) of what, below `count`.
        count: of things.
        odometry: base in odom.
        least_m: driving this far is some motion,
        least_rad: or turning by this much.
    """
    step = np.diff(odometry.xyyaw, axis=0, prepend=odometry.xyyaw[:1])
    driven = np.cumsum(np.hypot(step[:, 0], step[:, 1]))
    turned = np.cumsum(np.abs(se2.wrap_angle(step[:, 2])))
    at_ns, own_ns = t_ns - odometry.t_ns[0], odometry.t_ns - odometry.t_ns[0]
    driven, turned = np.interp(at_ns, own_ns, driven), np.interp(at_ns, own_ns, turned)
    keep = kernels.of_moving(thing, count, driven, turned, least_m, least_rad)
    return np.asarray(keep)


def observations_of(sightings: Sightings) -> Observations:
    """The sightings of surveyed things; the others are counted.

    A sensed point (x, y) has the range |(x, y)| and the bearing atan2(y, x); its stated covariance
    goes over with the derivative of the two by x and y.
    """
    surveyed = np.isin(sightings.name, sorted(sightings.surveyed))
    rows = np.flatnonzero(surveyed)
    rows = rows[np.argsort(sightings.t_ns[rows], kind="stable")]
    names, thing = np.unique(sightings.name[rows].astype(str), return_inverse=True)
    places = np.array([sightings.surveyed[name] for name in names]).reshape(-1, 3)
    x, y, yaw = sightings.xyyaw[rows].T
    reach, bearing = np.maximum(np.hypot(x, y), NEAREST_M), np.arctan2(y, x)
    cos, sin = np.cos(bearing), np.sin(bearing)
    J = np.zeros((len(rows), 2, 2))
    J[:, 0, 0], J[:, 0, 1] = cos, sin
    J[:, 1, 0], J[:, 1, 1] = -sin / reach, cos / reach
    stated = sightings.stated[rows].copy()
    stated[:, :2, :2] = J @ stated[:, :2, :2] @ np.swapaxes(J, 1, 2)
    turned = np.isfinite(yaw) & np.isfinite(places[thing, 2])
    return Observations(
        sightings.t_ns[rows],
        sightings.kind[rows],
        thing.astype(np.int64),
        places,
        np.column_stack([reach, bearing, np.where(turned, yaw, 0.0)]),
        np.where(turned, 3, 2).astype(np.int64),
        stated,
        int((~surveyed).sum()),
        names,
    )
