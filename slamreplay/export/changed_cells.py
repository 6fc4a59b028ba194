"""Changed cells of a map, region by region: the part of the grid that they take up."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from slamreplay.export.shown import Shown
from slamreplay.geometry import se2

#: Values of the cells that are handed on.
NONE, APPEARED, REMOVED = 0, 1, 2


def changed_cells(shown: Shown) -> Iterator[tuple[int, NDArray[np.uint8], se2.Array]]:
    """From when on which cells are known to have changed.

    A region's cells are told from the moment the robot first saw it; cells of no region with the
    first of them.

    Yields:
        Time ns, (h, w) of NONE, APPEARED and REMOVED, and the pose of its corner (0, 0).
    """
    grid, hindsight = shown.post.grid, shown.post.hindsight
    changes = None if hindsight is None else hindsight.changes
    if grid is None or changes is None:
        return
    cells = np.argwhere(changes.appeared | changes.removed)
    if not len(cells):
        return
    centres = grid.centre_of(cells)
    since = np.full(len(cells), np.iinfo(np.int64).max)
    for region in shown.regions:
        for box in (region.bbox_m, region.from_bbox_m):
            if box is None:
                continue
            reach = 0.5 * grid.resolution_m  # boxes go around centres or around cells
            inside = (centres >= np.array(box[:2]) - reach) & (centres <= np.array(box[2:]) + reach)
            mine = inside.all(axis=1)
            since[mine] = np.minimum(since[mine], region.first_seen_ns)
    lone = since == np.iinfo(np.int64).max
    since[lone] = since[~lone].min() if not lone.all() else shown.place_ns
    since = np.maximum(since, max(shown.place_ns, shown.start_ns))
    low, high = cells.min(axis=0), cells.max(axis=0) + 1
    corner = np.array([low[1] * grid.resolution_m, low[0] * grid.resolution_m, 0.0])
    part = np.zeros(high - low, dtype=np.uint8)
    kind = np.where(changes.appeared[tuple(cells.T)], APPEARED, REMOVED)
    for t_ns in np.unique(since):
        if t_ns > shown.end_ns:
            return
        now = since == t_ns
        part[tuple((cells[now] - low).T)] = kind[now]
        yield int(t_ns), part.copy(), se2.compose(grid.origin_xyyaw, corner)
