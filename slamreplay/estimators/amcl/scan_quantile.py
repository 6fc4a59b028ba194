"""How unlikely a scan is for the filter that is about to take it in.

A particle filter predicts no innovation and no covariance for it, but a whole distribution of
scans: a particle drawn by weight, and its beams by the laser model. The rank of the real scan's
log-likelihood among those of scans drawn like that is even over 0 to 1 if the filter is right,
whatever the likelihood is (a Monte Carlo test: Besag and Clifford 1989, Biometrika 76, 633-642; of
one-step predictions: Diebold, Gunther, Tay 1998, Int. Economic Review 39, 863-883).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.estimators.amcl.laser import Beams
from slamreplay.estimators.amcl.models import BeamScores
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.raycast import cast_rays

#: Drawn scans: the lowest rank of 20 is reached by chance in exactly 5 of 100 updates.
DRAWS = 19
#: Particles, drawn by weight, that stand for the whole cloud, and beams for the whole scan: with
#: more of either an update would take twice as long.
_CLOUD, _BEAMS = 32, 30
#: Of the generator; the filter's own stream stays as it is.
_STREAM = 1


class ScanQuantile:
    """Ranks scans among those that a cloud of particles and the laser model would give.

    A drawn beam ends, with probability z_hit / (z_hit + z_rand), at the first wall of the map with
    noise of sigma_hit, else anywhere within reach; where there is no wall a return is anywhere. The
    beams that returned are taken as given. The likelihood of a scan is the mean over the cloud of
    the product over its beams, as the likelihood field has it; nav2's sum of cubes, a scheme for
    weights, tells less.

    Args:
        config: the filter's.
        grid: the map.
        distance_m: (H, W) from each of its cells to the nearest wall, as the filter cuts it.
        seed: the trial's.
    """

    def __init__(
        self,
        config: AmclConfig,
        grid: OccupancyGrid,
        distance_m: NDArray[np.float32],
        seed: int | Sequence[int],
    ) -> None:
        self._config = config
        self._grid = grid
        self._rng = np.random.Generator(
            np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(_STREAM,)))
        )
        self._logs = BeamScores(config, grid, distance_m, None)

    def __call__(self, particles: se2.Array, weights: se2.Array, beams: Beams) -> float:
        """Quantile of a scan, (rank + 1/2) / (DRAWS + 1), or NaN where no beam is used.

        Args:
            particles: (N, 3) the cloud that was moved to the scan, and not yet weighed by it.
            weights: (N,) of it.
            beams: the scan.
        """
        c = self._config
        if not len(beams) or c.z_hit + c.z_rand <= 0.0:
            return float("nan")
        beams = beams.thinned(_BEAMS)
        cumulative = np.cumsum(weights)
        drawn = np.searchsorted(cumulative, cumulative[-1] * self._rng.random(_CLOUD + DRAWS))
        drawn = np.minimum(drawn, len(weights) - 1)
        cloud = np.ascontiguousarray(particles[drawn[:_CLOUD]].T)
        ranges_m = np.vstack([beams.ranges_m, self._ranges(particles[drawn[_CLOUD:]], beams)])
        table = self._logs.of(beams)
        score = table.log_means(table.local(cloud), beams.ends_at(ranges_m))
        below = int((score[1:] < score[0]).sum())
        return (below + 0.5) / (DRAWS + 1.0)

    def _ranges(self, particles: se2.Array, beams: Beams) -> se2.Array:
        """(K, M) returns drawn from the laser model at particles (K, 3), m."""
        c = self._config
        lasers = se2.compose(particles, np.asarray(beams.xyyaw_base_laser, dtype=np.float64))
        ranges_m = cast_rays(self._grid, lasers, beams.bearings, beams.reach_m)
        kind, anywhere = self._rng.random((2, *ranges_m.shape))
        noise = self._rng.standard_normal(ranges_m.shape)
        hits = np.isfinite(ranges_m) & (kind * (c.z_hit + c.z_rand) < c.z_hit)
        with np.errstate(invalid="ignore"):
            near = np.abs(ranges_m + c.sigma_hit * noise)  # no return comes from behind the laser
        return np.where(hits, near, anywhere * beams.reach_m)
