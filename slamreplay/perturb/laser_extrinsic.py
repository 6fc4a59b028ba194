"""A laser that does not sit where the robot believes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.scans import laser_transform
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.geometry import se3
from slamreplay.perturb.beams import scan_rows
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class LaserExtrinsic:
    """Move the laser's believed place on the robot; scans stay as they were measured.

    It acts on the transform next to the laser's frame, so that nothing else moves but what has that
    frame or hangs on it. A laser that tf does not place gets a place: the one it was taken to have,
    moved.
    """

    name: ClassVar[str] = "laser_extrinsic"
    variants: ClassVar[dict[str, Variant]] = {
        "x": Variant("m", 0.0, "believed this far ahead of where it is, along the base's x", -5, 5),
        "y": Variant("m", 0.0, "believed this far to the left of where it is", -5, 5),
        "yaw": Variant("deg", 0.0, "believed turned to the left by this, on its place", -180, 180),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"transforms", "scans"})

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with another mount.

        Raises:
            NotApplicableError: the log has no scans, or no base frame.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        rows = scan_rows(view, self.name)
        base = view.manifest.frames.base
        if not base:
            raise NotApplicableError("the log has no base frame to mount it on", where=self.name)
        laser = str(view.table("scans")["frame_id"][rows[0]])
        T_base_laser = laser_transform(view, laser)
        is_placed = T_base_laser is not None and laser != base
        T = T_base_laser if T_base_laser is not None else np.eye(4)
        believed = T.copy()
        if variant == "yaw":
            believed[:3, :3] = se3.from_planar([0.0, 0.0, np.radians(level)])[:3, :3] @ T[:3, :3]
        else:
            believed["xy".index(variant), 3] += level
        if not is_placed:
            return _placed(view, rows, base, laser, believed)
        return _moved(view, base, laser, se3.inverse(T) @ believed)


def _moved(view: BundleView, base: str, laser: str, T_laser_believed: np.ndarray) -> BundleView:
    """The view with the laser's frame moved in itself: in the edge that ends there."""
    edges = view.transforms.path(base, laser)
    edge = next(e for e in edges if laser in (e.parent, e.child))
    table = view.table("transforms")
    rows = np.flatnonzero(
        (table["parent_frame"] == edge.parent) & (table["child_frame"] == edge.child)
    )
    T = se3.matrix(table["translation_xyz"][rows], table["rotation_xyzw"][rows])
    T = T @ T_laser_believed if edge.child == laser else se3.inverse(T_laser_believed) @ T
    translation, rotation = table["translation_xyz"].copy(), table["rotation_xyzw"].copy()
    translation[rows], rotation[rows] = T[:, :3, 3], se3.quaternion(T[:, :3, :3])
    return view.with_table(table.replace(translation_xyz=translation, rotation_xyzw=rotation))


def _placed(
    view: BundleView, rows: np.ndarray, base: str, laser: str, T_base_laser: np.ndarray
) -> BundleView:
    """The view with a static transform for a laser that had none, in a frame of its own."""
    scans = view.table("scans")
    frame = f"{laser or 'laser'}_believed"
    names = scans["frame_id"].copy()
    names[rows] = frame
    start_ns = view.manifest.start_ns
    row = {
        "t_ns": [start_ns],
        "t_sensor_ns": [start_ns],
        "t_log_ns": [int(view.table("transforms")["t_log_ns"].max(initial=start_ns))],
        "topic": ["/tf_static"],
        "parent_frame": [base],
        "child_frame": [frame],
        "is_static": [True],
        "translation_xyz": T_base_laser[None, :3, 3],
        "rotation_xyzw": se3.quaternion(T_base_laser[None, :3, :3]),
    }
    table = view.table("transforms")
    table = Table.concat(table.schema, [table, Table(table.schema, row)])
    return view.with_table(scans.replace(frame_id=names)).with_table(table)
