"""The map that SLAM made, the way through it, and the loop closures that hold it together."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from slamreplay.estimators.pose_graph.product import MapAndGraph
from slamreplay.evidence.result import Postmortem
from slamreplay.geometry import se2
from slamreplay.report.figures import canvas
from slamreplay.report.figures.canvas import BLUE, GREEN, INK, VERMILLION, Part

#: Edge of a cell that beams are counted in, m; so many of them make a wall.
CELL_M, WALL_HITS = 0.05, 4.0
MARGIN_M = 1.0
#: Points this far from all of the way, m, and this share at each edge of the picture, would make
#: the rest too small to see.
FARTHEST_M, SPARE = 20.0, 1e-3


def graph_figure(made: MapAndGraph, width_in: float) -> Figure:
    """Where beams ended, the nodes, and every closure, accepted or not.

    Args:
        made: by `estimators.pose_graph.product.map_and_graph`.
        width_in: width of the paper, inches.
    """
    size = canvas.text_size(width_in)
    figure = canvas.new_figure(width_in, width_in)
    axes = figure.add_subplot()
    handles = draw_graph(axes, made, size)
    aspect = np.ptp(axes.get_ylim()) / np.ptp(axes.get_xlim())
    figure.set_size_inches(width_in, float(np.clip(width_in * aspect, 2.5, 14.0)) + 0.6)
    canvas.legend(figure, handles, size, 3)
    return figure


def graph_parts(post: Postmortem) -> tuple[Part, ...]:
    """The map of the pose graph; nothing where none ran."""
    made = post.slam
    if made is None:
        return ()
    return (Part("graph", lambda axes, size: draw_graph(axes, made, size)),)


def draw_graph(axes: Axes, made: MapAndGraph, size: float = 9.5) -> list[object]:
    """Draw it into axes; the handles of a legend."""
    xy = made.node_xyyaw[:, :2]
    low, high = xy.min(axis=0) - FARTHEST_M, xy.max(axis=0) + FARTHEST_M
    inside = made.points[((made.points > low) & (made.points < high)).all(axis=1)]
    hits, low, high = _counted(inside if len(inside) else xy)
    ink = LinearSegmentedColormap.from_list("ink", ["#ffffff", INK])
    extent = (low[0], high[0], low[1], high[1])
    axes.imshow(hits, origin="lower", extent=extent, cmap=ink, vmin=0.0, vmax=1.0, zorder=1)
    canvas.dress(axes, f"x in {made.frame_id} [m]", f"y in {made.frame_id} [m]", size)
    axes.set_aspect("equal")
    _draw_way(axes, made)
    taken, not_taken = made.closures[made.accepted], made.closures[~made.accepted]
    _draw_links(axes, xy, not_taken, VERMILLION, ":")
    _draw_links(axes, xy, taken, GREEN, "-")
    return [
        Line2D([], [], color=BLUE, lw=1.2, label=_count(len(xy), "node")),
        Line2D([], [], color=GREEN, lw=1.6, label=_count(len(taken), "loop closure")),
        Line2D([], [], color=VERMILLION, lw=1.2, ls=":", label=f"{len(not_taken)} rejected"),
    ]


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _counted(points: se2.Array) -> tuple[se2.Array, se2.Array, se2.Array]:
    """How much of a wall each cell is (H, W), 0 to 1, and the corners (2,) of the picture."""
    ends = np.quantile(points, [SPARE, 1.0 - SPARE], axis=0)
    points = points[((points >= ends[0]) & (points <= ends[1])).all(axis=1)]
    low = np.floor((ends[0] - MARGIN_M) / CELL_M) * CELL_M
    shape = np.ceil((ends[1] + MARGIN_M - low) / CELL_M).astype(np.int64)
    cell = ((points - low) / CELL_M).astype(np.int64)
    count = np.bincount(cell[:, 1] * shape[0] + cell[:, 0], minlength=int(shape.prod()))
    hits = np.minimum(count.reshape(shape[::-1]) / WALL_HITS, 1.0)
    return hits, low, low + shape * CELL_M


def _draw_way(axes: Axes, made: MapAndGraph) -> None:
    starts = np.flatnonzero(np.append(True, made.is_break[1:]))
    for first, stop in zip(starts, [*starts[1:], len(made.node_xyyaw)], strict=True):
        part = made.node_xyyaw[first:stop]
        axes.plot(part[:, 0], part[:, 1], color=BLUE, lw=0.8, zorder=3)
    begin = made.node_xyyaw[0]
    axes.plot(begin[0], begin[1], "o", color=BLUE, ms=5, zorder=4)


def _draw_links(
    axes: Axes, xy: se2.Array, pairs: NDArray[np.int64], colour: str, style: str
) -> None:
    ends = np.stack([xy[pairs[:, 0]], xy[pairs[:, 1]]], axis=1)
    axes.add_collection(
        LineCollection(list(ends), colors=colour, linestyles=style, lw=1.4, zorder=5)
    )
