"""The cells of a map below a figure's paths, and what of them is not true."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Patch
from matplotlib.transforms import Affine2D

from slamreplay.evidence.result import Postmortem
from slamreplay.geometry import se2
from slamreplay.maps.blocks import highest_in_blocks
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.report.figures.canvas import APPEARED, FAINT, REMOVED


def draw_grid(
    axes: Axes, post: Postmortem, grid: OccupancyGrid, low: se2.Array, high: se2.Array
) -> list[object]:
    """Draw what lies between two corners (2,), m: cells that changed over those that were mapped.

    Returns:
        Handles for a legend.
    """
    corners = np.array([low, [low[0], high[1]], high, [high[0], low[1]]])
    cells = grid.cell_of(corners)
    shape = np.array(grid.cells.shape)
    first = np.clip(cells.min(axis=0), 0, shape)
    last = np.clip(cells.max(axis=0) + 1, 0, shape)
    if (last <= first).any():
        return []  # the paths lie beside the map altogether
    part = (slice(first[0], last[0]), slice(first[1], last[1]))
    block = max(1, int(np.ceil(np.max(last - first) / 900)))
    image = np.ones((*highest_in_blocks(grid.occupied[part], block).shape, 3)) * to_rgb("#eceeea")
    image[highest_in_blocks(grid.free[part], block)] = to_rgb("#ffffff")
    image[highest_in_blocks(grid.occupied[part], block)] = to_rgb("#3b4146")
    handles: list[object] = []
    changes = None if post.hindsight is None else post.hindsight.changes
    if changes is not None:
        for mask, colour, label in (
            (changes.removed, REMOVED, "mapped, but gone"),
            (changes.appeared, APPEARED, "stands there, not mapped"),
        ):
            if mask[part].any():
                image[highest_in_blocks(mask[part], block)] = to_rgb(colour)
                handles.append(Patch(facecolor=colour, edgecolor=FAINT, lw=0.6, label=label))
    step = grid.resolution_m * block
    x0, y0 = first[1] * grid.resolution_m, first[0] * grid.resolution_m
    extent = (x0, x0 + image.shape[1] * step, y0, y0 + image.shape[0] * step)
    place = Affine2D().rotate(grid.origin_xyyaw[2]).translate(*grid.origin_xyyaw[:2])
    shown = axes.imshow(image, extent=extent, origin="lower", interpolation="nearest", zorder=1)
    shown.set_transform(place + axes.transData)
    return handles
