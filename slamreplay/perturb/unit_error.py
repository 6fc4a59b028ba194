"""Numbers told in one unit and read in another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.geometry import se2, se3
from slamreplay.geometry.se2 import Array
from slamreplay.geometry.times import Times
from slamreplay.perturb.beams import scan_beams
from slamreplay.perturb.inertial import inertial
from slamreplay.perturb.odometry_path import with_odometry
from slamreplay.perturb.variant import Variant, check_level, switch

_DEG, _MM = 180.0 / np.pi, 1000.0


@dataclass(frozen=True)
class UnitError:
    """Multiply what a driver tells by the ratio of two units; 1 does it, 0 leaves it.

    Those that happen: headings and turn rates in degrees where radians are asked for, or the other
    way round, and lengths in millimetres where metres are. A heading is told from -180 to 180 deg
    first and read then, so that it jumps where it was wrapped. Limits of a laser's range are
    parameters and stay: its returns then lie beyond them.
    """

    name: ClassVar[str] = "unit_error"
    variants: ClassVar[dict[str, Variant]] = {
        "odometry_deg_as_rad": switch("heading of odometry, told in degrees"),
        "odometry_rad_as_deg": switch("heading of odometry, read as degrees"),
        "odometry_mm_as_m": switch("place of odometry, told in millimetres"),
        "imu_deg_as_rad": switch("turn rates of the IMU, told in degrees per second"),
        "imu_rad_as_deg": switch("turn rates of the IMU, read as degrees per second"),
        "scan_mm_as_m": switch("ranges, told in millimetres"),
        "start_deg_as_rad": switch("heading of initial poses, told in degrees"),
    }
    touches: ClassVar[frozenset[str]] = frozenset(
        {"odometry", "transforms", "imu", "scans", "initial_poses"}
    )

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with these numbers in the other unit.

        Raises:
            NotApplicableError: the log has none of them.
            UsageError: the level is neither 0 nor 1.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        what, _, units = variant.partition("_")
        ratio = {"deg_as_rad": _DEG, "rad_as_deg": 1.0 / _DEG, "mm_as_m": _MM}[units]
        if what == "odometry":
            length, turn = (ratio, 1.0) if units == "mm_as_m" else (1.0, ratio)
            return self._odometry(view, length, turn)
        if what == "imu":
            return self._rates(view, ratio)
        return self._ranges(view, ratio) if what == "scan" else self._start(view, ratio)

    def _odometry(self, view: BundleView, length: float, turn: float) -> BundleView:
        def change(_: Times, xyyaw: Array) -> Array:
            return xyyaw * np.array([length, length, turn])

        def twists(_: Times, linear: Array, angular: Array) -> tuple[Array, Array]:
            return length * linear, turn * angular

        return with_odometry(view, self.name, change, twists)

    def _rates(self, view: BundleView, ratio: float) -> BundleView:
        unit = inertial(view, self.name)
        rate = unit.table["angular_velocity_xyz"].copy()
        rate[unit.rows] *= ratio
        return view.with_table(unit.table.replace(angular_velocity_xyz=rate))

    def _ranges(self, view: BundleView, ratio: float) -> BundleView:
        beams = scan_beams(view, self.name)
        return beams.with_ranges(beams.ranges_m * np.float32(ratio))

    def _start(self, view: BundleView, ratio: float) -> BundleView:
        table = view.table("initial_poses")
        rows = np.flatnonzero(table["topic"] == view.manifest.topic_of("initial_pose"))
        if not len(rows):
            raise NotApplicableError("nobody gave an initial pose in this log", where=self.name)
        turned = table["orientation_xyzw"].copy()
        yaw = se3.yaw_from_quaternion(turned[rows])
        turned[rows] = se3.yawed(turned[rows], se2.wrap_angle(ratio * yaw - yaw))
        return view.with_table(table.replace(orientation_xyzw=turned))
