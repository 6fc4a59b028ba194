"""The maps that hold at some time of a view."""

from __future__ import annotations

from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.maps.grid import OccupancyGrid


def held_maps(view: BundleView, name: str) -> dict[str, OccupancyGrid]:
    """Them by version, the one that holds last at the end.

    Raises:
        NotApplicableError: there is none.
    """
    last = reversed(dict.fromkeys(held.version for held in reversed(view.map_course)))
    grids = {version: view.grid_of(version) for version in last}
    found = {version: grid for version, grid in grids.items() if grid is not None}
    if not found:
        raise NotApplicableError("the log has no map", where=name)
    return found
