"""A match that is doubted is looked for again, in wider and wider windows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slamreplay.geometry import se2
from slamreplay.matching.correlative import Window, search_window
from slamreplay.matching.field import ScoreField, points_field
from slamreplay.matching.line_map import LineMap

#: Width of the score around what the map holds, and how far from the robot it is taken from.
SIGMA_M, RADIUS_M = 0.1, 15.0
WINDOWS = (
    Window(0.3, 0.1, np.radians(15.0), np.radians(2.0), pull=0.03),
    Window(1.2, 0.1, np.radians(30.0), np.radians(2.0), pull=0.03),
)
AROUND = Window(0.6, 0.1, np.pi, np.radians(3.0), pull=0.03)
#: So many points are enough to search with.
MOST_POINTS = 100


def search_field(local_map: LineMap, centre: se2.Array) -> ScoreField | None:
    """The score around what the map holds near `centre` (3,), or None where that is nothing."""
    points = local_map.points(centre[:2], RADIUS_M)
    return points_field(points, SIGMA_M) if len(points) else None


def places(
    field: ScoreField, points: se2.Array, expected: se2.Array, last: se2.Array
) -> Iterator[se2.Array]:
    """Where a scan might lie (3,), looked for as they are asked for, the nearest window first.

    Args:
        field: around the map.
        points: (P, 2) of the scan.
        expected: (3,) pose by odometry.
        last: (3,) pose of the scan before, which a robot that is turned by hand stays near.
    """
    some = points[:: -(-len(points) // MOST_POINTS)]
    for window in WINDOWS:
        yield search_window(field, some, expected, window)[0]
    yield search_window(field, some, last, AROUND)[0]
