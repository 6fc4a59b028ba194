"""Whether scans alone tell how far a robot went: between bare walls they tell nothing of it.

Two witnesses, for each fails by itself. A match that holds nothing in a direction has no curvature
there but what chance gives; but far points of a laser lie on a wall like beads on a string that
travels with it, and in a clean scan they fit best, and sharply, where nothing has moved. What the
walls face knows nothing of beads, but noise turns short pieces.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.hindsight.beams import HIT, Beams
from slamreplay.hindsight.chain import SIGMA_M, SPACING_M, Chain
from slamreplay.hindsight.weighing import NOISE
from slamreplay.matching.thinning import thin

#: A match whose weakest direction has less than this many times the curvature of chance holds
#: nothing there, nor do walls of which fewer than so many beams' worth face that way. Scans of a
#: laser of 8 m laid to each other along bare racks drifted by 0.7 to 10 m in a second below both,
#: and by 0.02 m from twice of it on.
CURVED_FROM, FACING_FROM = 1.5, 1.0
#: It is asked over this time: one poor scan is no bare wall.
OVER_S = 1.0
#: A normal is taken from neighbours so many beams away, the first of these that lie this far off,
#: about as far to both sides, and in line.
REACHES, SHORTEST_M, ALIKE, IN_LINE = (1, 2, 4), 0.1, 2.0, 0.95


def is_held(beams: Beams, chain: Chain) -> NDArray[np.bool_]:
    """(N,) scans whose motion is told in all directions by what they see.

    Args:
        beams: N scans.
        chain: all of them, each matched to those before it.
    """
    spacing_ns = float(np.median(np.diff(beams.t_ns))) if len(beams) > 1 else float(NS_PER_S)
    around = 2 * int(OVER_S * NS_PER_S / max(spacing_ns, 1.0) / 2) + 1
    curved, faced = (
        median_filter(values, around, mode="nearest")
        for values in (_curved(beams, chain), facing(beams))
    )
    return np.asarray((curved >= CURVED_FROM) & (faced >= FACING_FROM))


def _curved(beams: Beams, chain: Chain) -> se2.Array:
    """(N,) curvature of the matches in their weakest direction, over what chance gives."""
    known = np.flatnonzero(chain.information.any(axis=(1, 2)))  # the first has none before it
    if not len(known):
        return np.zeros(len(beams))
    count = np.array([len(thin(beams.points(k), SPACING_M)) for k in known.tolist()])
    weakest = np.linalg.eigvalsh(chain.information[known, :2, :2])[:, 0]
    ratio = weakest / (NOISE * np.sqrt(np.maximum(count, 1)) / SIGMA_M**2)
    nearest = np.minimum(np.searchsorted(known, np.arange(len(beams))), len(known) - 1)
    return np.asarray(ratio[nearest])


def facing(beams: Beams) -> se2.Array:
    """(N,) how many beams' worth of walls face the direction that fewest face.

    The smaller eigenvalue of the sum of n n' over the normals n at all points on walls. A normal
    is taken from the nearest neighbours that lie far enough apart.
    """
    sums = np.zeros((len(beams), 3))
    done = np.zeros(beams.kind.shape, dtype=bool)
    for reach in REACHES:
        if beams.kind.shape[1] <= 2 * reach:
            break
        parts = [slice(None, -2 * reach), slice(reach, -reach), slice(2 * reach, None)]
        before, middle, after = (beams.ends[:, p] for p in parts)
        one, two = middle - before, after - middle
        length, other = np.hypot(one[..., 0], one[..., 1]), np.hypot(two[..., 0], two[..., 1])
        asked = np.logical_and.reduce([beams.kind[:, p] == HIT for p in parts])
        asked &= ~done[:, parts[1]] & (np.minimum(length, other) >= SHORTEST_M)
        done[:, parts[1]] |= asked
        wall = asked & (np.maximum(length, other) < ALIKE * np.minimum(length, other))
        wall &= (one * two).sum(axis=-1) > IN_LINE * length * other
        along = after - before
        along = along / np.maximum(np.hypot(along[..., 0], along[..., 1]), 1e-9)[..., None]
        x, y = np.where(wall, along[..., 0], 0.0), np.where(wall, along[..., 1], 0.0)
        sums += np.stack([v.sum(axis=1, dtype=np.float64) for v in (x * x, y * y, x * y)], axis=1)
    xx, yy, xy = sums.T
    return np.asarray(0.5 * (xx + yy) - np.hypot(0.5 * (xx - yy), xy))
