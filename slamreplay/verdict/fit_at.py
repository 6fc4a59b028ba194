"""Do the scans fit the map where the robot believed to be?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.verdict.belief_error import BeliefError

_SCANS = 60


def fits_at_belief(
    view: BundleView, error: BeliefError, rows: NDArray[np.bool_], part: float
) -> bool:
    """Whether scans score at the believed poses at least this part of their score at hindsight's.

    Args:
        view: the log.
        error: belief against hindsight.
        rows: (N,) which of its rows to ask.
        part: 0 to 1.
    """
    from slamreplay.maps.likelihood_field import gaussian_field

    scans, grid = scan_set(view), view.grid
    if scans is None or grid is None:
        return False
    field = gaussian_field(grid, 0.12, 1.0)
    index = np.flatnonzero(rows)
    if not len(index):
        return False
    index = index[np.linspace(0, len(index) - 1, min(_SCANS, len(index))).astype(int)]
    scores = []
    for i in index:
        k = int(np.searchsorted(scans.t_ns, error.t_ns[i]))
        if k >= len(scans) or scans.t_ns[k] != error.t_ns[i]:
            continue
        points = scans.points(k)
        if not len(points):
            continue
        pair = []
        for pose in (error.belief[i], error.where[i]):
            cell = grid.cell_of(se2.transform_points(pose, points))
            inside = grid.inside(cell)
            pair.append(float(field[cell[inside, 0], cell[inside, 1]].sum()) / len(points))
        scores.append(pair)
    if not scores:
        return False
    at_belief, at_hindsight = np.mean(scores, axis=0)
    return bool(at_belief >= part * at_hindsight)
