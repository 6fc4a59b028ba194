"""The local costmap: a small window around the robot, filled from the last scan and inflated."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from slamreplay.geometry import se2
from slamreplay.simulate.sensors import XYYAW_BASE_LASER

RESOLUTION_M = 0.05
_CELLS = 60  # 3 m
#: Footprint of the robot as a circle, and how far costs reach beyond it.
ROBOT_RADIUS_M = 0.25
_INFLATION_M = 0.55
_COST_SCALING = 5.0
_LETHAL, _INSCRIBED = 100, 99


def local_costmap(
    xyyaw_odom_base: se2.Array, bearings: se2.Array, ranges: NDArray
) -> tuple[NDArray[np.int8], se2.Array]:
    """Costs (H, W) as nav_msgs/OccupancyGrid has them, and the window's origin (2,) in odom.

    The cost falls off as nav2_costmap_2d's inflation layer has it: exp(-scaling (d - radius)).

    Args:
        xyyaw_odom_base: (3,) the robot.
        bearings: (B,) rad.
        ranges: (B,) m; what is not finite and positive marks nothing.
    """
    origin = np.floor(xyyaw_odom_base[:2] / RESOLUTION_M - _CELLS / 2) * RESOLUTION_M
    good = np.isfinite(ranges) & (ranges > 0.0)
    ends = ranges[good, None] * np.column_stack([np.cos(bearings[good]), np.sin(bearings[good])])
    ends = se2.transform_points(se2.compose(xyyaw_odom_base, XYYAW_BASE_LASER), ends)
    cells = np.floor((ends - origin) / RESOLUTION_M).astype(np.int64)
    cells = cells[((cells >= 0) & (cells < _CELLS)).all(axis=1)]
    marked = np.zeros((_CELLS, _CELLS), dtype=bool)
    marked[cells[:, 1], cells[:, 0]] = True
    if not marked.any():
        return np.zeros(marked.shape, dtype=np.int8), origin
    distance = distance_transform_edt(~marked, sampling=RESOLUTION_M)
    decay = 98.0 * np.exp(-_COST_SCALING * (distance - ROBOT_RADIUS_M))
    costs = np.where(distance <= ROBOT_RADIUS_M, _INSCRIBED, np.minimum(decay, 98.0))
    costs = np.where(distance > _INFLATION_M, 0.0, costs)
    return np.where(marked, _LETHAL, costs).astype(np.int8), origin
