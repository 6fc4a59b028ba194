"""The filter on board: AMCL as the robots of the simulator run it, one scan at a time.

It is not the estimator that replays logs, as a robot's program is not either. Logs in the wild do
not change when that estimator does: the sample logs hang on every bit of this one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slamreplay.estimators.amcl import first_cloud, kernels
from slamreplay.estimators.amcl.cloud import (
    LEAST_RESULTANT,
    SHARE,
    circular_moments,
    cluster_of,
    histogram,
)
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.estimators.amcl.laser import Beams, likelihood_table, used_beams
from slamreplay.estimators.start import DEFAULT_COV
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.likelihood_field import distance_field
from slamreplay.simulate import onboard_kernels


class OnboardFilter:
    """A particle filter on a likelihood field, fed with odometry and scans.

    It follows nav2_amcl with the differential motion model and the `likelihood_field` laser model,
    and honours no parameters of others. Resampling is systematic, not multinomial; headings are one
    circle for histogram and clusters; recovery compares average likelihoods that do not depend on
    the particle count.

    Args:
        config: nav2_amcl's parameters.
        grid: the map.
        seed: of every random number it draws.
    """

    def __init__(self, config: AmclConfig, grid: OccupancyGrid, seed: int) -> None:
        self._config = config
        self._grid = grid
        self._rng = np.random.Generator(np.random.PCG64(seed))
        self._distance_m = distance_field(grid, config.laser_likelihood_max_dist)
        self._scores = np.empty((0, 0), dtype=np.float32)
        self._scores_range_m = np.nan
        self._last_odometry: se2.Array | None = None
        self._updates = 0
        self._slow = self._fast = 0.0
        self.initialise(np.zeros(3), DEFAULT_COV)

    @property
    def particles(self) -> se2.Array:
        """(N, 3) x y yaw in the map frame, read-only."""
        return self._particles

    @property
    def weights(self) -> se2.Array:
        """(N,) weights that sum to 1, read-only."""
        return self._weights

    @property
    def distance_m(self) -> NDArray[np.float32]:
        """(H, W) distance from each cell of the map to the nearest wall, cut, m."""
        return self._distance_m

    @property
    def mean_xyyaw(self) -> se2.Array:
        """(3,) weighted mean of the heaviest cluster, as nav2_amcl publishes it."""
        label = cluster_of(self._particles)
        rows = label == np.argmax(np.bincount(label, self._weights))
        mean, _ = circular_moments(self._particles[rows], self._weights[rows])
        return mean

    @property
    def clusters(self) -> int:
        """How many clusters carry a tenth of the weight or more: with two, mean and cov part."""
        return int((np.bincount(cluster_of(self._particles), self._weights) >= SHARE).sum())

    @property
    def cov(self) -> se2.Array:
        """(3, 3) of the whole set, as nav2_amcl publishes it with the heaviest cluster's mean.

        Only xx, xy, yy and yaw-yaw are filled; the latter is circular: -2 ln R, R the length of
        the mean heading vector.
        """
        mean, resultant = circular_moments(self._particles, self._weights)
        off = self._particles[:, :2] - mean[:2]
        cov = np.zeros((3, 3))
        cov[:2, :2] = (off * self._weights[:, None]).T @ off
        cov[1, 0] = cov[0, 1]
        cov[2, 2] = -2.0 * np.log(np.clip(resultant, LEAST_RESULTANT, 1.0))
        return cov

    @property
    def ess(self) -> float:
        """Effective sample size 1 / sum(w^2) of the latest weights, before resampling."""
        return self._ess

    def initialise(self, mean_xyyaw: ArrayLike, cov: ArrayLike) -> None:
        """Draw `max_particles` about a pose; the next scan updates without any motion.

        Args:
            mean_xyyaw: (3,) pose in the map frame.
            cov: (3, 3) of x y yaw; a diagonal of zeros puts all particles on the mean.
        """
        self._restart(first_cloud.about(self._rng, mean_xyyaw, cov, self._config.max_particles))

    def initialise_globally(self) -> None:
        """Spread `max_particles` evenly over the map's free cells and all headings.

        Raises:
            MapError: no cell of the map is free.
        """
        self._restart(first_cloud.anywhere(self._rng, self._grid, self._config.max_particles))

    def is_due(self, odometry_xyyaw: ArrayLike) -> bool:
        """Whether a scan taken at this odometry (3,) would update the filter."""
        if self._last_odometry is None:
            return True
        delta = np.abs(_delta(self._last_odometry, odometry_xyyaw))
        d, a = self._config.update_min_d, self._config.update_min_a
        return bool(delta[0] > d or delta[1] > d or delta[2] > a)

    def update(
        self,
        odometry_xyyaw: ArrayLike,
        bearings: ArrayLike,
        ranges_m: ArrayLike,
        usable: ArrayLike,
        xyyaw_base_laser: ArrayLike,
        range_max_m: float,
    ) -> bool:
        """Take in one scan, if the robot has moved enough or the filter has just been started.

        Args:
            odometry_xyyaw: (3,) base in odom at the scan's stamp.
            bearings: (B,) of the beams in the laser frame, rad.
            ranges_m: (B,) returns, m.
            usable: (B,) which beams are returns inside the laser's range.
            xyyaw_base_laser: (3,) where the laser sits on the robot.
            range_max_m: the laser's largest range; the uniform part is spread over it.

        Returns:
            Whether the filter was updated; if not, `mean_xyyaw` is still that of the last update.
        """
        if not self.is_due(odometry_xyyaw):
            return False
        self.predict(odometry_xyyaw)
        mount = xyyaw_base_laser
        self.correct(used_beams(self._config, bearings, ranges_m, usable, mount, range_max_m))
        return True

    def predict(self, odometry_xyyaw: ArrayLike) -> None:
        """Move the cloud to odometry (3,): what it then is was known before the next scan."""
        odometry = np.array(odometry_xyyaw, dtype=np.float64)
        if self._last_odometry is not None:
            self._move(self._last_odometry[2], _delta(self._last_odometry, odometry))
        self._last_odometry = odometry

    def correct(self, beams: Beams) -> None:
        """Weigh the cloud by a scan, and draw it anew where that is due."""
        self._weigh(beams)
        self._updates += 1
        if self._updates % self._config.resample_interval == 0:
            self._resample()

    def _move(self, old_yaw: float, delta: se2.Array) -> None:
        """nav2's differential model: the bearing of a step under 1 cm is not trusted."""
        c = self._config
        distance = float(np.hypot(delta[0], delta[1]))
        bearing = np.arctan2(delta[1], delta[0])
        turn1 = float(se2.wrap_angle(bearing - old_yaw)) if distance >= 0.01 else 0.0
        turn2 = float(se2.wrap_angle(delta[2] - turn1))
        # Driving backwards is a turn by pi in this model, and no noisier than driving forwards.
        size1 = min(abs(turn1), np.pi - abs(turn1))
        size2 = min(abs(turn2), np.pi - abs(turn2))
        variance = [
            c.alpha1 * size1**2 + c.alpha2 * distance**2,
            c.alpha3 * distance**2 + c.alpha4 * (size1**2 + size2**2),
            c.alpha1 * size2**2 + c.alpha2 * distance**2,
        ]
        particles = self._particles.copy()
        noise = self._rng.standard_normal(particles.shape)
        motion = np.array([turn1, distance, turn2])
        onboard_kernels.move(particles, motion, np.sqrt(variance), noise)
        self._adopt(particles, self._weights)

    def _weigh(self, beams: Beams) -> None:
        if self._scores_range_m != beams.reach_m:
            # A beam's likelihood cubed: nav2's ad-hoc weighting scheme.
            likelihood = likelihood_table(self._config, self._distance_m, beams.reach_m)
            self._scores = (likelihood**3).astype(np.float32)
            self._scores_range_m = beams.reach_m
        likelihood = onboard_kernels.likelihoods(
            self._particles,
            beams.ends,
            self._scores,
            self._grid.origin_xyyaw,
            self._grid.resolution_m,
        )
        weights = self._weights * likelihood
        average = float(weights.sum())
        c = self._config
        self._slow += (c.recovery_alpha_slow if self._slow else 1.0) * (average - self._slow)
        self._fast += (c.recovery_alpha_fast if self._fast else 1.0) * (average - self._fast)
        weights /= average
        self._ess = float(1.0 / np.sum(weights**2))
        self._adopt(self._particles, weights)

    def _resample(self) -> None:
        c = self._config
        particles, weights = self._particles, self._weights
        lost = max(0.0, 1.0 - self._fast / self._slow)
        if lost > 0.0:  # augmented MCL: the likelihood fell, so part of the set starts anywhere
            fresh = np.full(c.max_particles, lost / c.max_particles)
            particles = np.vstack(
                [particles, first_cloud.anywhere(self._rng, self._grid, c.max_particles)]
            )
            weights = np.concatenate([weights * (1.0 - lost), fresh])
            self._slow = self._fast = 0.0
        start_size, start_draw = self._rng.random(2)
        cumulative = np.cumsum(weights)
        distinct, bins = histogram(particles)
        n = kernels.kld_size(
            bins,
            len(distinct),
            cumulative,
            start_size,
            c.min_particles,
            c.max_particles,
            c.pf_err,
            c.pf_z,
        )
        rows = kernels.systematic(cumulative, start_draw, n)
        self._adopt(particles[rows], np.full(n, 1.0 / n))

    def _restart(self, particles: se2.Array) -> None:
        particles[:, 2] = se2.wrap_angle(particles[:, 2])
        self._last_odometry = None
        self._updates = 0
        self._slow = self._fast = 0.0
        self._adopt(particles, np.full(len(particles), 1.0 / len(particles)))
        self._ess = float(len(particles))

    def _adopt(self, particles: se2.Array, weights: se2.Array) -> None:
        particles, weights = np.ascontiguousarray(particles), np.ascontiguousarray(weights)
        particles.setflags(write=False)
        weights.setflags(write=False)
        self._particles, self._weights = particles, weights


def _delta(before: se2.Array, after: ArrayLike) -> se2.Array:
    """Difference of two odometry poses (3,) along the odometry frame's axes."""
    delta = np.asarray(after, dtype=np.float64) - before
    delta[2] = se2.wrap_angle(delta[2])
    return delta
