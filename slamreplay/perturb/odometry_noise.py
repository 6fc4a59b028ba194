"""Wheels that scatter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.geometry.se2 import Array
from slamreplay.geometry.times import Times
from slamreplay.perturb.driven import driven
from slamreplay.perturb.odometry_path import retold, turns_of, with_odometry
from slamreplay.perturb.variant import Variant, check_level

#: The noise is drawn once for each such part of the way, m, however often odometry is told.
_CELL_M = 0.05


@dataclass(frozen=True)
class OdometryNoise:
    """Add white noise to the steps of odometry: its sum grows with the root of the way.

    A higher level with the same seed is the same noise, larger. Velocities on the topic stay as
    they are, for nobody measures one over 5 cm.
    """

    name: ClassVar[str] = "odometry_noise"
    variants: ClassVar[dict[str, Variant]] = {
        "distance": Variant("m", 0.0, "standard deviation of the distance after 1 m", 0, 10),
        "heading": Variant("deg", 0.0, "standard deviation of the heading after 1 m", 0, 180),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"odometry", "transforms"})

    def apply(
        self, view: BundleView, variant: str, level: float, rng: np.random.Generator
    ) -> BundleView:
        """The view with other odometry.

        Raises:
            NotApplicableError: the log has no odometry, or the robot stands all along.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        way = driven(view, self.name)
        if way.length_m == 0.0:
            raise NotApplicableError("the robot does not drive in this log", where=self.name)
        at_m = np.arange(int(way.length_m / _CELL_M) + 2) * _CELL_M
        drawn = rng.standard_normal(len(at_m) - 1) * np.sqrt(_CELL_M)
        gathered = np.append(0.0, np.cumsum(drawn))  # after 1 m its variance is 1

        def noise(t_ns: Times) -> tuple[Array, Array]:
            distance = way.distance_at(t_ns)
            return np.diff(distance), np.diff(np.interp(distance, at_m, gathered))

        def longer(t_ns: Times, xyyaw: Array) -> Array:
            length, more = noise(t_ns)
            share = level * more / np.where(length > 0.0, length, 1.0)
            return retold(xyyaw, 1.0 + share, turns_of(xyyaw)[:, 2])

        def crooked(t_ns: Times, xyyaw: Array) -> Array:
            return retold(xyyaw, 1.0, turns_of(xyyaw)[:, 2] + np.radians(level) * noise(t_ns)[1])

        return with_odometry(view, self.name, longer if variant == "distance" else crooked)
