"""A map that lies elsewhere than it says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.perturb.held_maps import held_maps
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class MapShift:
    """Move the map in its own frame, as a wrong `origin` in the map's yaml does.

    Poses that were given or believed stay: a localizer that goes by the map ends so far from them.
    """

    name: ClassVar[str] = "map_shift"
    variants: ClassVar[dict[str, Variant]] = {
        "x": Variant("m", 0.0, "the map lies so far along the x axis of its frame", -1e4, 1e4),
        "y": Variant("m", 0.0, "the map lies so far along the y axis of its frame", -1e4, 1e4),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"map"})

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with every version of the map moved.

        Raises:
            NotApplicableError: the log has no map.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        shift = np.array([level, 0.0, 0.0] if variant == "x" else [0.0, level, 0.0])
        grids = held_maps(view, self.name)
        return view.with_grids({version: placed(grid, shift) for version, grid in grids.items()})


def placed(grid: OccupancyGrid, T_map_old: se2.Array) -> OccupancyGrid:
    """The map as it lies after a planar motion (3,) of its frame."""
    origin = se2.compose(T_map_old, grid.origin_xyyaw)
    return OccupancyGrid(grid.cells, grid.resolution_m, origin, grid.frame_id)
