"""AMCL over a whole log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Self

import numpy as np

from slamreplay.bundle.run import Estimate
from slamreplay.bundle.scans import ScanSet
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.estimators.amcl.filter import AmclFilter
from slamreplay.estimators.amcl.laser import Beams, used_beams
from slamreplay.estimators.amcl.parameters import LIVE, NAMES, config_from
from slamreplay.estimators.amcl.scan_quantile import ScanQuantile
from slamreplay.estimators.inputs import need_grid, need_odometry, need_scans
from slamreplay.estimators.start import DEFAULT_COV, GLOBAL, OFFSET, ROTATE, Start, starts
from slamreplay.geometry import se2

_DIAGNOSTICS = ("updated", "particles", "ess", "clusters", "likelihood_quantile")


@dataclass(frozen=True)
class Amcl:
    """Run the particle filter on every scan, from where the robot's own localizer started.

    It starts from the initial pose in the log, else from the first recorded belief, else anywhere;
    every later initial pose starts it again. Between updates the pose is carried by odometry, as
    tf does it, and the covariance stays the published one.

    Attributes:
        config: nav2_amcl's parameters.
        judge_scans: whether `likelihood_quantile` is measured; the estimate is the same without.
    """

    config: AmclConfig = field(default_factory=AmclConfig)
    judge_scans: bool = True

    parameter_names: ClassVar[frozenset[str]] = NAMES
    live_parameters: ClassVar[tuple[str, ...]] = LIVE
    name: ClassVar[str] = "amcl"
    needs: ClassVar[frozenset[str]] = frozenset({"odometry", "scans", "map"})
    settings: ClassVar[frozenset[str]] = frozenset({OFFSET, ROTATE, GLOBAL})
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

        Raises:
            NotApplicableError: no odometry, scans or map.
        """
        if self.config.laser_model_type != "likelihood_field":
            raise NotApplicableError("only runs with laser_model_type likelihood_field yet")
        if self.config.motion_model != "differential" or self.config.squared_motion_noise:
            raise NotApplicableError("only runs with nav2_amcl's differential model yet")
        scans = need_scans(view, self.name)
        odometry = need_odometry(view, self.name)
        grid = need_grid(view, self.name)
        T_odom_base = odometry.at(scans.t_ns).xyyaw
        known = np.flatnonzero(np.isfinite(T_odom_base).all(axis=1))
        told = self.config.initial_pose
        given = {start.row: start for start in starts(view, scans.t_ns, T_odom_base, told)}
        if not given and len(known):
            given = {int(known[0]): Start(int(known[0]), None, DEFAULT_COV)}
        amcl = AmclFilter(self.config, grid, seed)
        quantile = ScanQuantile(self.config, grid, amcl.distance_m, seed)

        n = len(scans)
        xyyaw, cov = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
        diagnostics = {name: np.full(n, np.nan) for name in _DIAGNOSTICS}
        T_map_odom, published, clusters = np.zeros(3), np.zeros((3, 3)), 0
        first = min(given, default=n)
        for row in known[known >= first].tolist():
            if row in given:
                _start(amcl, given[row])
            updated = amcl.is_due(T_odom_base[row])
            if updated:
                amcl.predict(T_odom_base[row])
                beams = self._beams(scans, row)
                if self.judge_scans:
                    rank = quantile(amcl.particles, amcl.weights, beams)
                    diagnostics["likelihood_quantile"][row] = rank
                amcl.correct(beams)
                T_map_odom = se2.compose(amcl.mean_xyyaw, se2.inverse(T_odom_base[row]))
                published, clusters = amcl.cov, amcl.clusters
            xyyaw[row] = se2.compose(T_map_odom, T_odom_base[row])
            cov[row] = published
            diagnostics["updated"][row] = float(updated)
            diagnostics["particles"][row] = float(len(amcl.particles))
            diagnostics["ess"][row] = amcl.ess
            diagnostics["clusters"][row] = float(clusters)
        frames = view.manifest.frames
        track = PoseTrack(
            frames.map or grid.frame_id, frames.base or "base_link", scans.t_ns, xyyaw, cov
        )
        return Estimate(track, (), diagnostics)

    def _beams(self, scans: ScanSet, row: int) -> Beams:
        return used_beams(
            self.config,
            scans.bearings(row),
            scans.ranges_m[row],
            scans.hits[row],
            scans.xyyaw_base_laser,
            float(scans.range_max_m[row]),
        )


def _start(amcl: AmclFilter, start: Start) -> None:
    if start.xyyaw is None:
        amcl.initialise_globally()
    else:
        amcl.initialise(start.xyyaw, start.cov)
