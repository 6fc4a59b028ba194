"""The particle clouds of a log, without what is no particle."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import BundleView
from slamreplay.geometry.se2 import Array
from slamreplay.geometry.transforms import clean_frame


def clouds_in(view: BundleView, frame: str) -> Table | None:
    """Rows of the localizer's particles in a frame, by time; None where there is none."""
    table = view.role("particles")
    if table is None or not len(table):
        return None
    wanted = clean_frame(frame)
    table = table.take(np.array([clean_frame(f) == wanted for f in table["frame_id"].tolist()]))
    return table.sorted_by_time() if len(table) else None


def sound_particles(xyyaw: ArrayLike, weights: ArrayLike) -> tuple[Array, Array]:
    """Particles (M, 3) with shares (M,) that sum to 1, of those that are finite and weigh anything.

    Args:
        xyyaw: (3 N,) or (N, 3) as recorded.
        weights: (N,) as recorded; all weigh the same where there are none, or none is positive.
    """
    particles = np.asarray(xyyaw, dtype=np.float64).reshape(-1, 3)
    share = np.asarray(weights, dtype=np.float64)
    good = np.isfinite(particles).all(axis=1)
    if len(share) != len(particles) or not (share[good] > 0.0).any():
        share = np.ones(len(particles))
    good &= np.isfinite(share) & (share >= 0.0)
    particles, share = particles[good], share[good]
    return particles, share / share.sum() if len(share) else share
