"""Lines, boxes and the view from above, as both writers for viewers draw them."""

from __future__ import annotations

import numpy as np

from slamreplay.export.shown import Shown
from slamreplay.geometry.se2 import Array

#: A box is drawn this far around what it holds, so that it hides nothing.
_AROUND_M = 0.1
#: Left free around everything.
_MARGIN_M = 1.0


def pieces(xy: Array) -> list[Array]:
    """Stretches of two or more known points of a path (N, 2) with NaN rows."""
    known = np.isfinite(xy).all(axis=1)
    edges = np.flatnonzero(np.diff(known.astype(np.int8), prepend=0, append=0))
    return [xy[a:b] for a, b in edges.reshape(-1, 2) if b - a > 1]


def box_corners(bbox_m: tuple[float, float, float, float]) -> Array:
    """(4, 2) corners around x_min, y_min, x_max, y_max, counter-clockwise."""
    x0, y0, x1, y1 = bbox_m
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    return corners + _AROUND_M * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def from_above(shown: Shown, aspect: float) -> tuple[Array, float]:
    """Centre (2,) of paths and maps, and how high a picture has to be to hold them, m.

    Args:
        shown: what there is.
        aspect: width over height of the picture.
    """
    tracks = [t for t in (shown.belief, shown.hindsight) if t is not None]
    points = [t.xyyaw[t.has_pose, :2] for t in tracks]
    points += [grid.centre_of(np.argwhere(grid.occupied)) for _, grid in shown.maps]
    points = [p for p in points if len(p)]
    if not points:
        return np.zeros(2), 30.0
    low = np.min([p.min(axis=0) for p in points], axis=0)
    high = np.max([p.max(axis=0) for p in points], axis=0)
    width, height = (high - low) + 2.0 * _MARGIN_M
    return (low + high) / 2.0, float(max(height, width / aspect))
