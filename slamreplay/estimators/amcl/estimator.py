"""AMCL over a whole log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.run import Estimate
from slamreplay.bundle.scans import ScanSet
from slamreplay.bundle.view import BundleView
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.estimators.amcl.filter import AmclFilter
from slamreplay.estimators.amcl.laser import Beams, used_beams
from slamreplay.estimators.amcl.ledger import Ledger
from slamreplay.estimators.amcl.match import ScanMatcher
from slamreplay.estimators.amcl.parameters import LIVE, NAMES, config_from
from slamreplay.estimators.amcl.scan_quantile import ScanQuantile
from slamreplay.estimators.inputs import need_grid, need_odometry, need_scans
from slamreplay.estimators.scales import MEASUREMENT_NOISE, PARTICLES, PROCESS_NOISE, scales_of
from slamreplay.estimators.start import DEFAULT_COV, GLOBAL, MOVED, Start, starts
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.likelihood_field import distance_field

#: A setting that a perturbation may change: a number that makes every random one another.
RANDOM_SEED = "random_seed"


@dataclass(frozen=True)
class Amcl:
    """Run the particle filter on every scan, from where the robot's own localizer started.

    It starts from the initial pose in the log, else from that of Nav2 parameters, else from the
    first recorded belief, else from that of ROS 1 parameters, else anywhere; every later initial
    pose starts it again. Between updates the pose is carried by odometry, as tf does it, and the
    covariance stays the published one.

    Attributes:
        config: parameters of nav2_amcl or of ROS 1's amcl.
        judge_scans: whether `likelihood_quantile` is measured and scans are matched for the ledger;
            the estimate is the same without.
    """

    config: AmclConfig = field(default_factory=AmclConfig)
    judge_scans: bool = True

    parameter_names: ClassVar[frozenset[str]] = NAMES
    live_parameters: ClassVar[tuple[str, ...]] = LIVE
    name: ClassVar[str] = "amcl"
    needs: ClassVar[frozenset[str]] = frozenset({"odometry", "scans", "map"})
    settings: ClassVar[frozenset[str]] = MOVED | {
        GLOBAL,
        PARTICLES,
        RANDOM_SEED,
        PROCESS_NOISE,
        MEASUREMENT_NOISE,
    }
    without_noise: ClassVar[str] = (
        "a likelihood field is no model of ranges, so that no world has the noise it takes"
    )

    @classmethod
    def from_parameters(cls, given: Mapping[str, object]) -> Self:
        """AMCL with parameters of nav2_amcl or of ROS 1's amcl, by their names.

        Raises:
            UsageError: one that there is not, or a value that makes no sense.
        """
        return cls(config_from(given, cls.name))

    def run(self, view: BundleView, *, seed: int) -> Estimate:
        """One row per scan; NaN before the start and where the scan has no odometry.

        Diagnostics: `updated` (1 where the filter took the scan in), `particles`, `ess`, the
        effective sample size before the latest resampling, `clusters`, how many carry a tenth of
        the weight or more: the mean is the heaviest one's, the covariance that of all, and at
        updates `likelihood_quantile`, the rank from 0 to 1 of the scan's likelihood among scans
        drawn from the filter's own prediction.

        The ledger's source `scan` has a row per update: where the scan alone fits best, less the
        pose that odometry carried there; S is the covariance of the predicted particles and that
        of the match. A particle filter predicts no such S itself: it is for the ledger only.

        Raises:
            NotApplicableError: no odometry, scans or map.
        """
        scans = need_scans(view, self.name)
        odometry = need_odometry(view, self.name)
        grid = need_grid(view, self.name)
        config, seeds = self._perturbed(view, seed)
        T_odom_base = odometry.at(scans.t_ns).xyyaw
        known = np.flatnonzero(np.isfinite(T_odom_base).all(axis=1))
        told = config.initial_pose if config.set_initial_pose else None
        given = {start.row: start for start in starts(view, scans.t_ns, T_odom_base, told)}
        if not given and len(known):
            pose, cov = config.initial_pose if config.know_initial_pose else (None, DEFAULT_COV)
            given = {int(known[0]): Start(int(known[0]), pose, cov)}
        amcl = AmclFilter(config, grid, seeds, _distances(view, grid, config))
        quantile = ScanQuantile(config, grid, amcl.distance_m, seeds)
        matcher = ScanMatcher(config, grid, amcl.distance_m)
        ledger = Ledger(scans.t_ns, T_odom_base, frame_id=view.manifest.frames.map or grid.frame_id)

        rows = known[known >= min(given, default=len(scans))]
        driven = T_odom_base[rows]
        stops = [*np.flatnonzero(np.isin(rows, list(given))).tolist(), len(rows)]
        for at, end in pairwise(stops):
            start = given[int(rows[at])]
            if start.xyyaw is None:
                amcl.initialise_globally()
            else:
                amcl.initialise(start.xyyaw, start.cov)
            ledger.begin(int(rows[at]), start.xyyaw)
            here = at
            while here < end:
                here += amcl.first_due(driven[here:end])
                if here == end:
                    break
                row = int(rows[here])
                amcl.predict(driven[here])
                beams = _beams(config, scans, row)
                if self.judge_scans:
                    returned = beams.returned
                    rank = quantile(amcl.particles, amcl.weights, returned)
                    ledger.judge(row, rank, returned, amcl)
                before = amcl.published
                amcl.correct(beams)
                ledger.update(row, amcl, is_published=amcl.published is not before or here == at)
                here += 1
        return ledger.estimate(rows, view.manifest.frames.base or "base_link", matcher)

    def _perturbed(self, view: BundleView, seed: int) -> tuple[AmclConfig, tuple[int, ...]]:
        """The configuration and the words of the seed, as a perturbation changes them."""
        c, ratio = self.config.scaled(*scales_of(view)), view.settings.get(PARTICLES, 1.0)
        if ratio != 1.0:
            least, most = (max(1, round(ratio * n)) for n in (c.min_particles, c.max_particles))
            c = replace(c, min_particles=least, max_particles=most)
        words = (c.random_seed if c.random_seed >= 0 else seed,)
        other = round(view.settings.get(RANDOM_SEED, 0.0)) % 2**32
        return c, (*words, other) if other else words


def _distances(view: BundleView, grid: OccupancyGrid, config: AmclConfig) -> NDArray[np.float32]:
    """The map's distances to walls, once for all trials whose map has these cells, moved or not."""
    most = config.laser_likelihood_max_dist
    return view.bundle.shared.of(
        "distances", (grid.resolution_m, most), [grid.cells], lambda: distance_field(grid, most)
    )


def _beams(config: AmclConfig, scans: ScanSet, row: int) -> Beams:
    return used_beams(
        config,
        scans.bearings(row),
        scans.ranges_m[row],
        scans.hits[row],
        scans.xyyaw_base_laser,
        float(scans.range_max_m[row]),
        scans.misses[row],
    )
