"""The cost grid that held at a time: the last whole one, and the windows that came since."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import BundleView
from slamreplay.maps.grid import OccupancyGrid


@dataclass(frozen=True, eq=False)
class Costmap:
    """A cost grid, 0 to 100 and -1, and when it was last told of (ns on the bundle's clock)."""

    grid: OccupancyGrid
    t_ns: int


class Costmaps:
    """The cost grids of one topic.

    Asked in the order of time, each window is laid down once.

    Args:
        whole: rows of table `costmaps`, of one topic.
        windows: rows of table `costmap_updates` of the same grid.
    """

    def __init__(self, whole: Table, windows: Table) -> None:
        self.whole, self.windows = whole.sorted_by_time(), windows.sorted_by_time()
        # A window of the same moment as a whole grid belongs to it if it was recorded later.
        after = np.searchsorted(self.whole.t_ns, self.windows.t_ns, side="right") - 1
        tied = (after >= 0) & (self.whole.t_ns[np.maximum(after, 0)] == self.windows.t_ns)
        sooner = self.windows["t_log_ns"] < self.whole["t_log_ns"][np.maximum(after, 0)]
        self._of = np.where(tied & sooner, after - 1, after)
        self._row, self._next = -1, 0
        self._grid: OccupancyGrid | None = None

    @classmethod
    def of(cls, view: BundleView) -> Costmaps | None:
        """Those of the topic that plays the costmap; None where no whole one was recorded."""
        whole = view.role("costmap")
        if whole is None or not len(whole):
            return None
        windows = view.table("costmap_updates")
        return cls(whole, windows.take(windows["grid_topic"] == whole["topic"][0]))

    def at(self, t_ns: int) -> Costmap | None:
        """The grid that held at a time, None before the first whole one."""
        row = int(np.searchsorted(self.whole.t_ns, t_ns, side="right")) - 1
        if row < 0:
            return None
        first, last = np.searchsorted(self._of, [row, row + 1]).tolist()
        last = min(last, int(np.searchsorted(self.windows.t_ns, t_ns, side="right")))
        if self._grid is None or row != self._row or self._next > last:
            self._row, self._next, self._grid = row, first, whole_grid(self.whole, row)
        told = int(self.whole.t_ns[row])
        if self._next < last:
            self._grid = self._with_windows(self._grid, self._next, last)
            self._next = last
        if first < last:
            told = int(self.windows.t_ns[last - 1])
        return Costmap(self._grid, told)

    def _with_windows(self, grid: OccupancyGrid, first: int, last: int) -> OccupancyGrid:
        cells, own = grid.cells.copy(), self.windows
        for k in range(first, last):
            x, y, width, height = (int(own[c][k]) for c in ("x", "y", "width", "height"))
            window = own["cells"][k].reshape(height, width)
            part = cells[y : y + height, x : x + width]
            part[:] = window[: part.shape[0], : part.shape[1]]
        return OccupancyGrid(cells, grid.resolution_m, grid.origin_xyyaw, grid.frame_id)


def whole_grid(costmaps: Table, row: int) -> OccupancyGrid:
    """One row of table `costmaps` as a grid."""
    height, width = int(costmaps["height"][row]), int(costmaps["width"][row])
    return OccupancyGrid(
        costmaps["cells"][row].reshape(height, width).copy(),
        float(costmaps["resolution_m"][row]),
        np.array(costmaps["origin_xyyaw"][row]),
        str(costmaps["frame_id"][row]),
    )
