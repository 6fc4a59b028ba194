"""Axes that point the other way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2, se3
from slamreplay.geometry.se2 import Array
from slamreplay.geometry.times import Times
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.perturb.beams import scan_beams
from slamreplay.perturb.held_maps import held_maps
from slamreplay.perturb.inertial import inertial
from slamreplay.perturb.odometry_path import with_odometry
from slamreplay.perturb.variant import Variant, check_level, switch

#: Signs of y and of the heading.
_SIGNS = {"odometry_y": (-1.0, 1.0), "odometry_yaw": (1.0, -1.0), "odometry": (-1.0, -1.0)}


@dataclass(frozen=True)
class Handedness:
    """Mirror what a part of the robot tells; 1 does it, 0 leaves it.

    ROS has x ahead, y to the left and z up (REP-103), so that a turn to the left is positive.
    Drivers of marine and aerial robots have y to the right and z down, many range finders sweep
    clockwise, and images count their rows from the top.
    """

    name: ClassVar[str] = "handedness"
    variants: ClassVar[dict[str, Variant]] = {
        "odometry": switch("odometry with y to the right and turns to the right positive"),
        "odometry_y": switch("odometry with y to the right, headings as they are"),
        "odometry_yaw": switch("odometry with turns to the right positive, places as they are"),
        "scan_order": switch("beams told from the last to the first"),
        "imu_yaw": switch("IMU with turns to the right positive"),
        "map_rows": switch("rows of the map read from the wrong end"),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"odometry", "transforms", "scans", "imu", "map"})

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with that mirrored.

        Raises:
            NotApplicableError: the log does not have it.
            UsageError: the level is neither 0 nor 1.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        if variant in _SIGNS:
            return self._odometry(view, *_SIGNS[variant])
        if variant == "scan_order":
            return self._scans(view)
        return self._inertial(view) if variant == "imu_yaw" else self._map(view)

    def _odometry(self, view: BundleView, y: float, yaw: float) -> BundleView:
        def change(_: Times, xyyaw: Array) -> Array:
            return xyyaw * np.array([1.0, y, yaw])

        def twists(_: Times, linear: Array, angular: Array) -> tuple[Array, Array]:
            return linear * np.array([1.0, y, 1.0]), angular * np.array([1.0, 1.0, yaw])

        return with_odometry(view, self.name, change, twists)

    def _scans(self, view: BundleView) -> BundleView:
        beams = scan_beams(view, self.name)
        ragged = beams.table["ranges_m"]
        ends = np.repeat(ragged.offsets[:-1] + ragged.offsets[1:] - 1, ragged.lengths)
        return beams.with_ranges(beams.ranges_m[ends - np.arange(len(ends))])

    def _inertial(self, view: BundleView) -> BundleView:
        unit = inertial(view, self.name)
        rate, turned = (
            unit.table[name].copy() for name in ("angular_velocity_xyz", "orientation_xyzw")
        )
        rate[unit.rows] -= 2.0 * (rate[unit.rows] @ unit.up)[:, None] * unit.up
        yaw = se3.yaw_from_quaternion(turned[unit.rows])
        turned[unit.rows] = se3.yawed(turned[unit.rows], se2.wrap_angle(-2.0 * yaw))
        changed = unit.table.replace(angular_velocity_xyz=rate, orientation_xyzw=turned)
        return view.with_table(changed)

    def _map(self, view: BundleView) -> BundleView:
        grids = held_maps(view, self.name)
        return view.with_grids({version: _mirrored(grid) for version, grid in grids.items()})


def _mirrored(grid: OccupancyGrid) -> OccupancyGrid:
    cells = np.ascontiguousarray(grid.cells[::-1])
    return OccupancyGrid(cells, grid.resolution_m, grid.origin_xyyaw, grid.frame_id)
