"""Codes as the robot saw them, with the places that are known of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.sightings import Sightings
from slamreplay.estimators.ekf.noise import Noise
from slamreplay.estimators.ekf.observations import NEAR_M, Observations, cartesian
from slamreplay.geometry import se2

#: Nothing is measured better than this, whatever a log states: 1 mm, 1 mrad.
_FINEST = np.diag([1e-6, 1e-6, 1e-6])


@dataclass(frozen=True)
class CodeNoise:
    """Standard deviations of what is read of a code.

    Attributes:
        code_m: of its place along each axis, m: print, lens and where it was laid.
        code_rad: of its heading, rad.
    """

    code_m: float
    code_rad: float


@dataclass(frozen=True, eq=False)
class Codes(Observations):
    """Sightings of codes: `sensed` holds x m, y m and heading rad in the base.

    Attributes:
        code_noise: of those whose covariance the log does not state.
    """

    code_noise: CodeNoise = CodeNoise(0.005, 0.01)

    @property
    def is_near(self) -> NDArray[np.bool_]:
        """(M,) all: a code is held against x and y wherever it was seen."""
        return np.ones(len(self), dtype=bool)

    def corrected(self, noise: Noise) -> se2.Array:  # noqa: ARG002 - no lens is known
        """(M, 3) `sensed`, as it is."""
        return self.sensed.copy()

    def covariance(self, noise: Noise, scale: float = 1.0) -> se2.Array:
        """(M, 3, 3) of `sensed`: the log's own, else a code's, or a tag's where it is not near.

        Args:
            noise: of ranges, bearings and headings of tags, and the ratio for what is stated.
            scale: ratio by which all variances are multiplied.
        """
        x, y, heading = self.sensed.T
        away = np.hypot(x, y)
        polar = np.zeros((len(self), 3, 3))
        polar[:, 0, 0] = noise.range_m**2 + (noise.range_per_m * away) ** 2
        polar[:, 1, 1], polar[:, 2, 2] = noise.bearing_rad**2, noise.heading_rad**2
        _, R = cartesian(np.column_stack([away, np.arctan2(y, x), heading]), polar)
        own = self.code_noise
        R[away < NEAR_M] = np.diag([own.code_m, own.code_m, own.code_rad]) ** 2
        told = np.isfinite(self.stated[:, :2, :2]).all(axis=(1, 2))
        R[told, :2, :2] = noise.stated_ratio**2 * self.stated[told, :2, :2]
        turned = np.isfinite(self.stated[:, 2, 2])
        R[turned, 2, 2] = noise.stated_ratio**2 * self.stated[turned, 2, 2]
        return scale * (R + _FINEST)

    @staticmethod
    def in_base(sensed: se2.Array, R: se2.Array) -> tuple[se2.Array, se2.Array]:
        """`sensed` (M, 3) and R (M, 3, 3), which are of the base already."""
        return sensed, R


def codes_of(sightings: Sightings, places: Mapping[str, se2.Array], code_noise: CodeNoise) -> Codes:
    """The sightings of things whose places (3,) are known, in order of time; others are counted.

    Args:
        sightings: of a log.
        places: by the name that sightings have; a heading that is not known is NaN.
        code_noise: of what is read.
    """
    known = np.isin(sightings.name, sorted(places))
    rows = np.flatnonzero(known)
    rows = rows[np.argsort(sightings.t_ns[rows], kind="stable")]
    names, thing = np.unique(sightings.name[rows].astype(str), return_inverse=True)
    at = np.array([places[name] for name in names]).reshape(-1, 3)
    turned: NDArray[np.bool_] = np.isfinite(sightings.xyyaw[rows, 2]) & np.isfinite(at[thing, 2])
    sensed = sightings.xyyaw[rows].copy()
    sensed[~turned, 2] = 0.0
    return Codes(
        sightings.t_ns[rows],
        sightings.kind[rows],
        thing.astype(np.int64),
        at,
        sensed,
        np.where(turned, 3, 2).astype(np.int64),
        sightings.stated[rows],
        int((~known).sum()),
        names,
        code_noise=code_noise,
    )
