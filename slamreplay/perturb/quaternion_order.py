"""Quaternions whose w was told first."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.perturb.inertial import inertial
from slamreplay.perturb.odometry_path import told_odometry
from slamreplay.perturb.variant import Variant, check_level, switch


@dataclass(frozen=True)
class QuaternionOrder:
    """Read quaternions that were told as w x y z as x y z w; 1 does it, 0 leaves it.

    ROS has x y z w; Eigen's constructor, MuJoCo and the firmware of many inertial units have w
    first. No rotation, 1 0 0 0, is then half a turn about x: a robot in a plane has the same
    heading for ever, and a laser lies on its back.
    """

    name: ClassVar[str] = "quaternion_order"
    variants: ClassVar[dict[str, Variant]] = {
        "odometry": switch("those of odometry, on tf and on the topic"),
        "tf": switch("those of all transforms, static ones too"),
        "initial_pose": switch("those of initial poses"),
        "imu": switch("those of the IMU's orientation"),
    }
    touches: ClassVar[frozenset[str]] = frozenset(
        {"odometry", "transforms", "initial_poses", "imu"}
    )

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with these quaternions.

        Raises:
            NotApplicableError: the log has none of them.
            UsageError: the level is neither 0 nor 1.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        if variant == "odometry":
            told = told_odometry(view, self.name)
            if len(told.topic):
                view = view.with_table(_misread(view.table("odometry"), told.topic))
            if len(told.tf):
                view = view.with_table(_misread(view.table("transforms"), told.tf))
            return view
        if variant == "imu":
            unit = inertial(view, self.name)
            return view.with_table(_misread(unit.table, unit.rows))
        table = view.table("transforms" if variant == "tf" else "initial_poses")
        rows = np.arange(len(table))
        if variant == "initial_pose":
            rows = np.flatnonzero(table["topic"] == view.manifest.topic_of("initial_pose"))
        if not len(rows):
            what = "tf is empty" if variant == "tf" else "nobody gave an initial pose"
            raise NotApplicableError(f"{what} in this log", where=self.name)
        return view.with_table(_misread(table, rows))


def _misread(table: Table, rows: NDArray[np.int64]) -> Table:
    name = "rotation_xyzw" if table.schema.name == "transforms" else "orientation_xyzw"
    quaternion = table[name].copy()
    quaternion[rows] = np.roll(quaternion[rows], 1, axis=1)
    return table.replace(**{name: quaternion})
