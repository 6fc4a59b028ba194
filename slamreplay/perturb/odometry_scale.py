"""Wheels of another size than the robot thinks, or another distance apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.geometry import se2, se3
from slamreplay.perturb.tf_delay import moving_odometry
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class OdometryScale:
    """Scale every step of odometry, on tf and on the topic alike."""

    name: ClassVar[str] = "odometry_scale"
    variants: ClassVar[dict[str, Variant]] = {
        "translation": Variant("ratio", 1.0, "reported over driven distance", 0, 10),
        "rotation": Variant("ratio", 1.0, "reported over turned angle", 0, 10),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"odometry", "transforms"})

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with other odometry.

        Raises:
            NotApplicableError: the log has no odometry, or tf has it upside down (base -> odom).
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        scale = (level, 1.0) if variant == "translation" else (1.0, level)
        table = view.table("odometry")
        rows = np.flatnonzero(table["topic"] == view.manifest.topic_of("odometry"))
        try:
            moving = moving_odometry(view, self.name)
        except NotApplicableError:
            if not len(rows):
                raise
            moving = []
        transforms = view.table("transforms")
        if any(edge.child == view.manifest.frames.odom for edge in moving):
            raise NotApplicableError("tf has base above odometry", where=self.name)
        for edge in moving:
            chosen = (transforms["parent_frame"] == edge.parent) & (
                transforms["child_frame"] == edge.child
            )
            transforms = _scaled(
                transforms,
                np.flatnonzero(chosen),
                scale,
                ("translation_xyz", "rotation_xyzw"),
            )
        table = _scaled(table, rows, scale, ("position_xyz", "orientation_xyzw"))
        linear, angular = table["linear_velocity_xyz"].copy(), table["angular_velocity_xyz"].copy()
        linear[rows] *= scale[0]
        angular[rows] *= scale[1]
        table = table.replace(linear_velocity_xyz=linear, angular_velocity_xyz=angular)
        return view.with_table(table).with_table(transforms)


def _scaled(
    table: Table, rows: np.ndarray, scale: tuple[float, float], names: tuple[str, str]
) -> Table:
    """The poses of these rows, rebuilt of scaled steps; height, roll and pitch stay."""
    if not len(rows):
        return table
    rows = rows[np.argsort(table.t_ns[rows], kind="stable")]
    position, quaternion = table[names[0]].copy(), table[names[1]].copy()
    yaw = se3.yaw_from_quaternion(quaternion[rows])
    path = np.column_stack([position[rows, :2], yaw])
    steps = np.nan_to_num(se2.between(path[:-1], path[1:]))
    heading = yaw[0] + scale[1] * np.append(0.0, np.cumsum(steps[:, 2]))
    cos, sin = np.cos(heading[:-1]), np.sin(heading[:-1])
    dx = scale[0] * (cos * steps[:, 0] - sin * steps[:, 1])
    dy = scale[0] * (sin * steps[:, 0] + cos * steps[:, 1])
    position[rows, 0] = path[0, 0] + np.append(0.0, np.cumsum(dx))
    position[rows, 1] = path[0, 1] + np.append(0.0, np.cumsum(dy))
    s, c = np.sin((heading - yaw) / 2.0), np.cos((heading - yaw) / 2.0)
    x, y, z, w = quaternion[rows].T
    quaternion[rows] = np.column_stack([c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z])
    return table.replace(**{names[0]: position, names[1]: quaternion})
