"""One update of a particle filter beside its cloud: of which particles are mean and covariance?"""

from __future__ import annotations

import numpy as np

from slamreplay.consistency.evidence.clouds import sound_particles
from slamreplay.estimators.amcl.cloud import SHARE, cluster_of, moments
from slamreplay.estimators.amcl.kernels import CELL_M, YAW_CELLS
from slamreplay.geometry import se2

#: A cluster that carries this share of the weight, and no other a tenth, is the cloud.
WHOLE = 0.5
#: Two means are told apart from so many cells on, two covariances from this ratio on.
_CELLS_APART, _RATIO = 1.0, 2.0


def mixed_up(
    pose: se2.Array, cov: se2.Array, particles: se2.Array, weights: se2.Array
) -> tuple[float, str] | None:
    """How far the two means lie apart where they are mixed up, else 0, and that in words.

    None where it cannot be told: no particles, or a pose that is neither of these.

    Args:
        pose: (3,) that was published.
        cov: (3, 3) that was published.
        particles: (M, 3) of the cloud.
        weights: (M,) or none.
    """
    particles, weights = sound_particles(particles, weights)
    if not len(particles):
        return None
    label = cluster_of(particles)
    carried = np.bincount(label, weights)
    heavy = np.flatnonzero((carried >= SHARE) | (carried == carried.max()))
    if len(heavy) < 2 and carried.max() >= WHOLE:
        return 0.0, ""
    whole = moments(particles, weights)
    parts = [moments(particles[label == k], weights[label == k]) for k in heavy.tolist()]
    nearest = int(np.argmin([_cells(pose, part.mean_xyyaw) for part in parts]))
    own = parts[nearest]
    between = _cells(whole.mean_xyyaw, own.mean_xyyaw)
    to_whole, to_own = _cells(pose, whole.mean_xyyaw), _cells(pose, own.mean_xyyaw)
    given, of_whole, of_own = (_spread(c, cov) for c in (cov, whole.cov, own.cov))
    if between < _CELLS_APART or of_whole < _RATIO * of_own or not given > 0.0:
        return 0.0, ""  # one cluster can stand for the other
    if min(to_whole, to_own) > between / 2.0:
        return None
    mean_is_own = to_own < to_whole
    cov_is_own = abs(np.log(given / of_own)) < abs(np.log(given / of_whole))
    if mean_is_own == cov_is_own:
        return 0.0, ""
    shares = " and ".join(f"{100.0 * share:.0f} %" for share in sorted(carried[heavy])[:-4:-1])
    sigma = [np.sqrt(np.trace(c[:2, :2]) / 2.0) for c in (own.cov, whole.cov)]
    of = ("one cluster's", "that of all particles")
    words = f"the heaviest clusters carried {shares} of the weight, sigma of the position was "
    words += f"{sigma[0]:.2g} m in one and {sigma[1]:.2g} m over all particles, the mean is "
    words += f"{of[not mean_is_own]} and the covariance {of[not cov_is_own]}"
    return between, words


def _cells(one: se2.Array, other: se2.Array) -> float:
    """How far two poses (3,) lie apart, in the cells that nav2_amcl makes clusters with."""
    turn = float(se2.wrap_angle(one[2] - other[2]))
    return float(np.hypot(np.hypot(*(one - other)[:2]) / CELL_M, turn * YAW_CELLS / (2.0 * np.pi)))


def _spread(cov: se2.Array, given: se2.Array) -> float:
    """Sum of the variances (3, 3) in squared cells, the heading's only where it was published."""
    place = float(cov[0, 0] + cov[1, 1]) / CELL_M**2
    turn = float(cov[2, 2]) * (YAW_CELLS / (2.0 * np.pi)) ** 2
    return place + turn if np.isfinite(given[2, 2]) else place
