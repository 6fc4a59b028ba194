"""The filter, one scan at a time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slamreplay.estimators.amcl import first_cloud, kernels
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.estimators.amcl.heaps import Published, cell_of, cov_of, published
from slamreplay.estimators.amcl.laser import Beams, used_beams
from slamreplay.estimators.amcl.models import laser_model
from slamreplay.estimators.amcl.motion import drive, step_of
from slamreplay.estimators.amcl.noise import normals
from slamreplay.estimators.start import DEFAULT_COV
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.likelihood_field import distance_field

#: A cloud is converged when all of it is this near to its mean along x and along y, m (nav2_amcl).
_CONVERGED_M = 0.5
#: Of the generator that moves particles; the other draws everything else.
_MOTION_STREAM = 1


class AmclFilter:
    """A particle filter fed with odometry and scans, as nav2_amcl is.

    Both motion models, all three laser models, KLD sampling, augmented MCL recovery, and what is
    published when. It differs where this gives the same answer sooner or is told apart by tests:
    resampling is systematic, not multinomial; headings are one circle for histogram and clusters;
    recovery compares average likelihoods that do not depend on the particle count.

    Args:
        config: the parameters.
        grid: the map.
        seed: of every random number it draws; words of one.
        distance_m: (H, W) of `distance_field` for this map and configuration, where it is known.
    """

    def __init__(
        self,
        config: AmclConfig,
        grid: OccupancyGrid,
        seed: int | Sequence[int],
        distance_m: NDArray[np.float32] | None = None,
    ) -> None:
        self._config = config
        self._grid = grid
        self._rng = np.random.Generator(np.random.PCG64(seed))
        words = np.random.SeedSequence(seed, spawn_key=(_MOTION_STREAM,)).generate_state(2)
        self._keys = int(words[0]), int(words[1])
        self._moves = self._updates = 0
        self._slow = self._fast = self._ess = 0.0
        self._is_converged = False
        self._particles, self._weights = np.empty((3, 0)), np.empty(0)
        if distance_m is None:
            distance_m = distance_field(grid, config.laser_likelihood_max_dist)
        self._distance_m = distance_m
        self._likelihood = laser_model(config, grid, self._distance_m)
        self._last_odometry: se2.Array | None = None
        self.initialise(np.zeros(3), DEFAULT_COV)

    @property
    def particles(self) -> se2.Array:
        """(N, 3) x y yaw in the map frame, read-only."""
        return _read_only(self._particles.T)

    @property
    def weights(self) -> se2.Array:
        """(N,) weights that sum to 1, read-only."""
        return _read_only(self._weights)

    @property
    def distance_m(self) -> NDArray[np.float32]:
        """(H, W) distance from each cell of the map to the nearest wall, cut, m."""
        return self._distance_m

    @property
    def published(self) -> Published:
        """What the latest resampling, or start, made known: the robot's pose and covariance."""
        return self._published

    @property
    def cov(self) -> se2.Array:
        """(3, 3) of the whole set as it is now, as `published` has it."""
        return cov_of(self._particles, self._weights)

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
        return self.first_due(np.atleast_2d(np.asarray(odometry_xyyaw, dtype=np.float64))) == 0

    def first_due(self, odometry_xyyaw: se2.Array) -> int:
        """The first of scans taken at odometry (N, 3) that would update the filter; N for none."""
        if self._last_odometry is None:
            return 0
        d, a = self._config.update_min_d, self._config.update_min_a
        return int(kernels.first_beyond(odometry_xyyaw, self._last_odometry, d, a))

    def update(
        self,
        odometry_xyyaw: ArrayLike,
        bearings: ArrayLike,
        ranges_m: ArrayLike,
        usable: ArrayLike,
        xyyaw_base_laser: ArrayLike,
        range_max_m: float,
        missed: ArrayLike = False,
    ) -> bool:
        """Take in one scan, if the robot has moved enough or the filter has just been started.

        Args:
            odometry_xyyaw: (3,) base in odom at the scan's stamp.
            bearings: (B,) of the beams in the laser frame, rad.
            ranges_m: (B,) returns, m.
            usable: (B,) which beams are returns inside the laser's range.
            xyyaw_base_laser: (3,) where the laser sits on the robot.
            range_max_m: the laser's largest range; the uniform part is spread over it.
            missed: (B,) which beams saw nothing to the end of it.

        Returns:
            Whether the filter was updated; if not, `published` is as it was.
        """
        if not self.is_due(odometry_xyyaw):
            return False
        self.predict(odometry_xyyaw)
        mount = xyyaw_base_laser
        self.correct(
            used_beams(self._config, bearings, ranges_m, usable, mount, range_max_m, missed)
        )
        return True

    def predict(self, odometry_xyyaw: ArrayLike) -> None:
        """Move the cloud to odometry (3,): what it then is was known before the next scan."""
        odometry = np.array(odometry_xyyaw, dtype=np.float64)
        if self._last_odometry is not None:
            delta = odometry - self._last_odometry
            delta[2] = se2.wrap_angle(delta[2])
            step = step_of(self._config, float(self._last_odometry[2]), delta)
            noise = np.empty(self._particles.shape, dtype=np.float32)
            normals(self._moves, *self._keys, noise)
            particles = self._particles.copy()
            drive(particles, step.numbers, noise)
            self._moves += 1
            self._particles = particles
        self._last_odometry = odometry

    def correct(self, beams: Beams) -> None:
        """Weigh the cloud by a scan, and draw it anew where that is due."""
        c = self._config
        self._weigh(beams)
        self._updates += 1
        if self._updates % c.resample_interval == 0:
            if not c.selective_resampling or self._ess <= 0.5 * len(self._weights):
                self._resample()
            self._published = published(self._particles, self._weights)

    def _weigh(self, beams: Beams) -> None:
        likelihood, log_factor = self._likelihood(
            self._particles, beams, is_converged=self._is_converged
        )
        weights = self._weights * likelihood
        total = float(weights.sum())
        average = total * float(np.exp(log_factor))
        c = self._config
        self._slow += (c.recovery_alpha_slow if self._slow else 1.0) * (average - self._slow)
        self._fast += (c.recovery_alpha_fast if self._fast else 1.0) * (average - self._fast)
        weights /= total
        self._ess = float(1.0 / (weights @ weights))
        self._weights = weights

    def _resample(self) -> None:
        c = self._config
        particles, weights = self._particles, self._weights
        lost = max(0.0, 1.0 - self._fast / self._slow) if self._slow > 0.0 else 0.0
        if lost > 0.0:  # augmented MCL: the likelihood fell, so part of the set starts anywhere
            fresh = np.full(c.max_particles, lost / c.max_particles)
            anywhere = np.ascontiguousarray(
                first_cloud.anywhere(self._rng, self._grid, c.max_particles).T
            )
            particles = np.concatenate([particles, anywhere], axis=1)
            weights = np.concatenate([weights * (1.0 - lost), fresh])
            self._slow = self._fast = 0.0
        start_size, start_draw = self._rng.random(2)
        n = c.max_particles
        if c.min_particles < n:
            cell = np.empty(len(weights), dtype=np.int64)
            cells = len(cell_of(particles, cell))
            n = kernels.kld_size(
                cell, cells, np.cumsum(weights), start_size, c.min_particles, n, c.pf_err, c.pf_z
            )
        drawn = np.empty((3, n))
        kernels.draw(particles, weights, start_draw, drawn)
        self._particles, self._weights = drawn, np.full(n, 1.0 / n)
        if c.do_beamskip:  # nothing else asks
            off = np.abs(drawn[:2] - drawn[:2].mean(axis=1, keepdims=True))
            self._is_converged = bool(off.max() <= _CONVERGED_M)

    def _restart(self, particles: se2.Array) -> None:
        particles[:, 2] = se2.wrap_angle(particles[:, 2])
        self._last_odometry = None
        self._updates = 0
        self._slow = self._fast = 0.0
        self._is_converged = False
        n = len(particles)
        self._particles, self._weights = np.ascontiguousarray(particles.T), np.full(n, 1.0 / n)
        self._ess = float(n)
        self._published = published(self._particles, self._weights)


def _read_only(array: se2.Array) -> se2.Array:
    """A view: an array that were itself read-only would have every loop compiled twice."""
    view = array.view()
    view.setflags(write=False)
    return view
