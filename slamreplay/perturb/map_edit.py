"""A map of before something changed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.geometry import se2
from slamreplay.maps.edits import with_walls, with_walls_moved, without_walls
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.perturb.held_maps import held_maps
from slamreplay.perturb.seen_places import Seen, disc_around
from slamreplay.perturb.variant import Variant, check_level

#: What has moved is drawn so far from where it stands, towards the robot's path, m.
_MOVED_M = 0.7


@dataclass(frozen=True)
class MapEdit:
    """Edit the map where the robot passes and sees, so that the scans contradict it there.

    The level is the diameter of a disc in which the map is edited, and the seed says where: at a
    place that many scans see from where the robot believed to be. A greater level with the same
    seed edits the same walls or free cells, and more.
    """

    name: ClassVar[str] = "map_edit"
    variants: ClassVar[dict[str, Variant]] = {
        "appeared": Variant("m", 0.0, "walls of a place so wide are missing in the map", 0, 100),
        "removed": Variant("m", 0.0, "the map has walls on a free place so wide", 0, 100),
        "moved": Variant("m", 0.0, "walls of a place so wide are drawn 0.7 m off", 0, 100),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"map"})

    def apply(
        self, view: BundleView, variant: str, level: float, rng: np.random.Generator
    ) -> BundleView:
        """The view with every version of the map edited at one place.

        Raises:
            NotApplicableError: the log has no map, no scans, nothing that says where the robot
                was, or its scans see no wall or no free place of the map.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        grids = held_maps(view, self.name)
        seen = Seen.by(view, list(grids.values())[-1], self.name)
        found = seen.free(rng) if variant == "removed" else seen.wall(rng)
        if found is None:
            what = "free place" if variant == "removed" else "wall"
            raise NotApplicableError(f"the scans see no {what} of the map", where=self.name)
        place, robot = found
        return view.with_grids(
            {v: _edited(grid, variant, place, robot, level) for v, grid in grids.items()}
        )


def _edited(
    grid: OccupancyGrid, variant: str, place: se2.Array, robot: se2.Array, size_m: float
) -> OccupancyGrid:
    """The map with what stands (or could stand) within so many metres changed."""
    cells = disc_around(grid, place, size_m)
    if variant == "removed":
        return with_walls(grid, cells[grid.free[cells[:, 0], cells[:, 1]]])
    walls = cells[grid.occupied[cells[:, 0], cells[:, 1]]]
    if variant == "appeared":
        return without_walls(grid, walls)
    way = robot - place
    part = min(_MOVED_M / max(float(np.hypot(*way)), 1e-9), 0.5)
    return with_walls_moved(grid, walls, way * part)[0]
