"""Where rays meet discs: people, posts and pallets as a planar laser sees them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from slamreplay.geometry.se2 import Array


def range_to_disc(off_xy: Array, direction: Array, radius_m: ArrayLike) -> Array:
    """(N,) range at which each ray enters its disc, inf where it misses it or starts inside.

    Args:
        off_xy: (N, 2) the disc's middle from the ray's origin, m.
        direction: (N,) of each ray in the same axes, rad.
        radius_m: of the discs, one or (N,).
    """
    along = off_xy[:, 0] * np.cos(direction) + off_xy[:, 1] * np.sin(direction)
    beside2 = np.sum(off_xy**2, axis=1) - along**2
    radius2 = np.asarray(radius_m) ** 2
    half = np.sqrt(np.maximum(radius2 - beside2, 0.0))
    return np.where((beside2 < radius2) & (along > half), along - half, np.inf)
