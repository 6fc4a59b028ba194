"""A gyroscope that turns by itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se3
from slamreplay.geometry.times import NS_PER_S
from slamreplay.perturb.inertial import inertial
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class GyroBias:
    """Add a constant turn about the robot's upright axis to what the inertial unit tells.

    The level is in degrees gained per second, from the first message on. An orientation that the
    unit tells gains it as well: without a compass it is the sum of the rates.
    """

    name: ClassVar[str] = "gyro_bias"
    variants: ClassVar[dict[str, Variant]] = {
        "yaw": Variant("deg", 0.0, "gained to the left in every second", -180, 180),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"imu"})

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with other rates.

        Raises:
            NotApplicableError: the log has no IMU.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        unit, bias = inertial(view, self.name), float(np.radians(level))
        table, rows = unit.table, unit.rows
        rate, turned = table["angular_velocity_xyz"].copy(), table["orientation_xyzw"].copy()
        rate[rows] += bias * unit.up
        seconds = (table.t_ns[rows] - table.t_ns[rows[0]]) / NS_PER_S
        turned[rows] = se3.yawed(turned[rows], bias * seconds)
        return view.with_table(table.replace(angular_velocity_xyz=rate, orientation_xyzw=turned))
