"""A map that is turned."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.perturb.held_maps import held_maps
from slamreplay.perturb.map_shift import placed
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class MapRotate:
    """Turn the map in its own frame; poses that were given or believed stay.

    About the middle of what it knows, so that the walls move by no more than half of its size,
    wherever the frame's origin is.
    """

    name: ClassVar[str] = "map_rotate"
    variants: ClassVar[dict[str, Variant]] = {
        "centre": Variant(
            "deg", 0.0, "turned to the left by this, about the middle of what is mapped", -180, 180
        ),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"map"})

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with every version of the map turned about one point.

        Raises:
            NotApplicableError: the log has no map.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        grids = held_maps(view, self.name)
        newest = list(grids.values())[-1]
        about = np.append(_middle(newest), 0.0)
        turn = se2.compose(about, [0.0, 0.0, np.radians(level)])
        T_map_old = se2.compose(turn, se2.inverse(about))
        return view.with_grids({v: placed(grid, T_map_old) for v, grid in grids.items()})


def _middle(grid: OccupancyGrid) -> se2.Array:
    """(2,) middle of the box around all known cells, of the whole grid where none is known."""
    known = grid.cells >= 0
    spans = []
    for axis in (1, 0):
        at = np.flatnonzero(known.any(axis=axis))
        spans.append((at[0] + at[-1]) / 2.0 if len(at) else (grid.cells.shape[1 - axis] - 1) / 2.0)
    return grid.centre_of(np.array(spans))
