"""The best pose of a window, up to the whole map, by branch and bound.

Hess et al. (Real-time loop closure in 2D lidar SLAM, ICRA 2016) bound squares of places at one
heading. Here a node also spans up to eight headings: each point is looked up in a table widened by
what it moves over them. What is found is the optimum of the lattice, as if every pose were scored.

The coarsest nodes are bounded all together, by adding whole tables of bytes, which a processor does
32 or more at a time; only what is left after that is looked up point by point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.matching import bound_kernels
from slamreplay.matching.field import ScoreField
from slamreplay.matching.pyramid import BYTE, LEVELS, LONGEST_RUN, SPREADS, Pyramid
from slamreplay.matching.threads import share_out

#: So many coarsest nodes are worth adding up together. At first there are about so many at most,
#: and if more than a share of them is left, up to so many more on a finer level.
_WORTH_ADDING, _FIRST_NODES, _FEW, _MOST_NODES = 64, 500_000, 0.02, 20_000_000
#: The least coarse of the coarsest levels: one square less costs more runs than it spares nodes.
_LEAST_LEVEL = 3
#: Coarsest nodes are shared out to threads from here on.
_WORTH_A_THREAD = 32


@dataclass(frozen=True, eq=False)
class PoseWindow:
    """Poses to search: a lattice about a centre, which is one of its poses.

    Attributes:
        centre: (3,) x, y, yaw in the field's frame.
        reach_m: to either side along the field's x and y axes.
        reach_rad: to either side in yaw; from pi on all headings.
    """

    centre: se2.Array
    reach_m: tuple[float, float]
    reach_rad: float

    @classmethod
    def whole(cls, field: ScoreField) -> PoseWindow:
        """Every cell of a field, all headings."""
        extent = np.array(field.values.shape[::-1]) * field.resolution_m
        centre = np.append(field.corner_xy + extent / 2.0, 0.0)
        return cls(centre, (float(extent[0] / 2.0), float(extent[1] / 2.0)), np.pi)


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best pose of a window.

    Attributes:
        xyyaw: (3,) in the field's frame.
        score: mean over the points of the scores of the cells they lie in, 0 to 1.
        nodes: how many were bounded one by one, a measure of the work.
    """

    xyyaw: se2.Array
    score: float
    nodes: int


def heading_step(points: se2.Array, resolution_m: float) -> float:
    """The turn that moves the farthest of points (N, 2) by one cell: Hess et al. 2016, eq. 7."""
    farthest = max(float(np.hypot(points[:, 0], points[:, 1]).max(initial=0.0)), resolution_m)
    return float(np.arccos(1.0 - resolution_m**2 / (2.0 * farthest**2)))


def best_pose(
    bounds: Pyramid,
    points: se2.Array,
    window: PoseWindow,
    *,
    step_rad: float | None = None,
    min_score: float = 0.0,
) -> Optimum | None:
    """The best pose of the window's lattice: places one cell apart, headings `step_rad` apart.

    Args:
        bounds: of the field that is searched.
        points: (N, 2) m, about the pose that is looked for.
        window: the poses.
        step_rad: lattice of headings, `heading_step` of the points unless told.
        min_score: a pose must score more than this.

    Returns:
        The optimum; one of them where poses score exactly alike. None where no pose scores more
        than `min_score`, or there are no points.
    """
    if not len(points):
        return None
    field, points = bounds.field, np.ascontiguousarray(points, dtype=np.float64)
    lattice = _lattice(field, points, window, step_rad)
    search = _search(bounds, lattice)
    best = np.array([min_score * len(points), -1.0, -1.0, -1.0, 0.0])
    level = int(search[1][6])
    while True:
        tops = _bound_tops(bounds, search, level)
        # A good pose found early prunes the rest: the best node of each run comes first.
        flat = tops.reshape(-1)
        first = tops.reshape(len(tops), -1).argmax(axis=1) + np.arange(len(tops)) * tops[0].size
        _visit(bounds, search, level, flat, first, best)
        flat[first] = 0
        left = np.flatnonzero(flat > best[0] * BYTE)
        # Where much is left, as in a cloud that half fits, adding up finer nodes costs less.
        if len(left) < _FEW * len(flat) or level == _LEAST_LEVEL or 8 * len(flat) > _MOST_NODES:
            break
        level -= 1
    _visit(bounds, search, level, flat, left, best)
    if best[3] < 0.0:
        return None
    xy = lattice.corner_xy + best[[2, 1]] * field.resolution_m
    yaw = se2.wrap_angle(lattice.headings[int(best[3])])
    return Optimum(np.append(xy, yaw), float(best[0] / len(points)), int(best[4]))


def _visit(
    bounds: Pyramid,
    search: tuple[NDArray, ...],
    level: int,
    tops: NDArray[np.int32],
    nodes: NDArray[np.int64],
    best: se2.Array,
) -> None:
    nodes = nodes[np.argsort(-tops[nodes], kind="stable")]
    bound_kernels.descend(
        bounds.field.values, bounds.bounds, search, level, nodes, tops[nodes], best
    )


@dataclass(frozen=True, eq=False)
class _Lattice:
    """Poses: `shape` (rows, columns) of cells from `corner_xy`, at each of the `headings` (K,).

    `cells` (K, N, 2) int32: column and row of each point from the first place.
    """

    corner_xy: se2.Array
    shape: tuple[int, int]
    headings: se2.Array
    cells: NDArray[np.int32]
    longest_run: int


def _lattice(
    field: ScoreField, points: se2.Array, window: PoseWindow, step_rad: float | None
) -> _Lattice:
    resolution = field.resolution_m
    step = heading_step(points, resolution) if step_rad is None else step_rad
    if window.reach_rad >= np.pi:
        turns = np.arange(int(np.ceil(2.0 * np.pi / step)), dtype=np.float64)
        step = 2.0 * np.pi / len(turns)
    else:
        reach = int(np.ceil(window.reach_rad / step - 1e-9))
        turns = np.arange(-reach, reach + 1, dtype=np.float64)
    headings = window.centre[2] + turns * step
    sides = np.ceil(np.array(window.reach_m) / resolution - 1e-9).astype(np.int64)
    corner = window.centre[:2] - sides * resolution
    cells = np.empty((len(headings), len(points), 2), dtype=np.int32)
    bound_kernels.cells(
        points, np.cos(headings), np.sin(headings), *(corner - field.corner_xy), resolution, cells
    )
    # How far the farthest point moves in a run must not be more than the tables are widened by.
    farthest = float(np.hypot(points[:, 0], points[:, 1]).max())
    run = LONGEST_RUN
    while (
        run > 1
        and 2.0 * farthest * np.sin(min((run - 1) * step, np.pi) / 2.0)
        > (SPREADS[-1] - 1e-6) * resolution
    ):
        run //= 2
    rows, cols = 2 * int(sides[1]) + 1, 2 * int(sides[0]) + 1
    return _Lattice(corner, (rows, cols), headings, cells, run)


def _search(bounds: Pyramid, lattice: _Lattice) -> tuple[NDArray, ...]:
    """What the kernels go by: the lattice, its coarsest level, and room for the nodes' tables."""
    rows, cols = lattice.shape
    headings, points = lattice.cells.shape[:2]
    level = _LEAST_LEVEL
    while (rows >> level) * (cols >> level) * headings // lattice.longest_run > _FIRST_NODES:
        if level == LEVELS:
            break
        level += 1
    shape = np.array(
        [rows, cols, headings, bounds.margin, *bounds.padded, level, lattice.longest_run]
    )
    # Runs of a level begin at `starts`; a run's tables are filled in when it is first looked at.
    starts = np.zeros(level + 2, dtype=np.int64)
    for k in range(1, level + 1):
        run = min(1 << k, lattice.longest_run)
        starts[k + 1] = starts[k] + -(-headings // run)
    where = np.empty((int(starts[-1]), points, 3), dtype=np.int64)
    ranges = np.zeros((int(starts[-1]), 5), dtype=np.int64)
    return lattice.cells, shape, starts, where, ranges


def _bound_tops(bounds: Pyramid, search: tuple[NDArray, ...], level: int) -> NDArray[np.int32]:
    """(runs, rows, columns) bounds of all nodes of a level, in `BYTE`s of score."""
    shape, starts = search[1], search[2]
    square = 1 << level
    rows, cols = -(-int(shape[0]) // square), -(-int(shape[1]) // square)
    runs = int(starts[level + 1] - starts[level])
    tops = np.zeros((runs, rows, cols), dtype=np.int32)
    width = int(shape[5]) // square
    worth = rows * cols >= _WORTH_ADDING and cols <= width

    def work(first: int, stop: int) -> None:
        total = np.zeros(rows * width if worth else 0, dtype=np.uint16)
        bound_kernels.add_tables(bounds.bounds, search, level, first, stop, total, tops)

    share_out(runs, work, _WORTH_A_THREAD)
    return tops
