"""Beams against the convex outline of a solid: which end at it, which go through it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.simulate.worlds import Solid


def ends_in(solid: Solid, rays: se2.Array, reach: se2.Array) -> NDArray[np.bool_]:
    """(N,) beams that end within a decimetre of a convex outline.

    Args:
        solid: its corners run anticlockwise.
        rays: (N, 3) origin and direction, in the frame of the solid.
        reach: (N,) m.
    """
    x = rays[:, 0] + reach * np.cos(rays[:, 2])
    y = rays[:, 1] + reach * np.sin(rays[:, 2])
    return _depth(solid, x, y) < 0.1


def passes(solid: Solid, rays: se2.Array, reach: se2.Array) -> NDArray[np.bool_]:
    """(N,) beams that go through a convex outline before they end (Cyrus and Beck, 1978).

    Arguments are those of `ends_in`.
    """
    dx, dy = np.cos(rays[:, 2]), np.sin(rays[:, 2])
    enter, leave = np.zeros(len(rays)), reach.copy()
    possible = np.ones(len(rays), dtype=bool)
    for nx, ny, offset in _edges(solid):
        ahead = nx * dx + ny * dy
        outside = nx * rays[:, 0] + ny * rays[:, 1] - offset
        with np.errstate(divide="ignore", invalid="ignore"):
            at = -outside / ahead
        enter = np.where(ahead < 0.0, np.maximum(enter, at), enter)
        leave = np.where(ahead > 0.0, np.minimum(leave, at), leave)
        possible &= (ahead != 0.0) | (outside <= 0.0)
    return possible & (enter < leave)


def _depth(solid: Solid, x: se2.Array, y: se2.Array) -> se2.Array:
    """(N,) distance outside the outline's edges, negative inside."""
    return np.max([nx * x + ny * y - offset for nx, ny, offset in _edges(solid)], axis=0)


def _edges(solid: Solid) -> list[tuple[float, float, float]]:
    """Outward unit normal and offset of each edge of an anticlockwise outline."""
    corners = np.array(solid.corners)
    out = []
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        length = float(np.hypot(bx - ax, by - ay))
        nx, ny = float(by - ay) / length, float(ax - bx) / length
        out.append((nx, ny, float(nx * ax + ny * ay)))
    return out


def bbox(solid: Solid, offset: se2.Array) -> tuple[float, float, float, float]:
    """Least x and y and greatest x and y in the map frame that the transform `offset` leads to."""
    corners = se2.transform_points(offset, np.array(solid.corners))
    x0, y0 = (float(v) for v in corners.min(axis=0))
    x1, y1 = (float(v) for v in corners.max(axis=0))
    return x0, y0, x1, y1
