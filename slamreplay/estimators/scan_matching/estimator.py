"""Scan matching over a whole log: odometry corrected by what the laser sees, without a map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import ClassVar, Self

import numpy as np

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.run import Estimate
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError, UsageError
from slamreplay.estimators.inputs import need_scans
from slamreplay.estimators.parameters import settings_from
from slamreplay.estimators.scales import MEASUREMENT_NOISE, PROCESS_NOISE, scales_of
from slamreplay.estimators.scan_matching.config import MatchConfig
from slamreplay.estimators.scan_matching.drift import drifted, in_frame
from slamreplay.estimators.scan_matching.ledger import match_innovations
from slamreplay.estimators.scan_matching.local import local_trajectory_of
from slamreplay.estimators.scan_matching.trajectory import LocalTrajectory
from slamreplay.estimators.start import MOVED, Start, starts
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import turned


@dataclass(frozen=True)
class ScanMatching:
    """Lay each scan onto a map of those before it, weighed against odometry where there is any.

    In the map where the log says a pose in it (initial pose, else the first recorded belief), else
    in the odometry frame from a certain zero. It closes no loops, so its error grows with the way.

    Attributes:
        config: hyper-parameters.
    """

    config: MatchConfig = field(default_factory=MatchConfig)

    parameter_names: ClassVar[frozenset[str]] = frozenset(f.name for f in fields(MatchConfig))
    name: ClassVar[str] = "scan_matching"
    needs: ClassVar[frozenset[str]] = frozenset({"scans"})
    settings: ClassVar[frozenset[str]] = MOVED | {PROCESS_NOISE, MEASUREMENT_NOISE}
    without_noise: ClassVar[str] = "what a match weighs is measured on the log, not told"

    @classmethod
    def from_parameters(cls, given: Mapping[str, object]) -> Self:
        """Scan matching with other hyper-parameters, by their names in the configuration.

        Raises:
            UsageError: one that there is not, or a value that it cannot take.
        """
        config = settings_from(MatchConfig, given, where=cls.name)
        for name in sorted(cls.parameter_names - {"icp"}):
            if not getattr(config, name) > 0.0:
                raise UsageError(
                    f"'{name}' is {getattr(config, name)}: it should be more than 0", where=cls.name
                )
        return cls(config)

    def run(self, view: BundleView, *, seed: int) -> Estimate:  # noqa: ARG002 - nothing is random
        """One row per scan, NaN before the start and the first scan with enough points.

        Diagnostics: `score` of each match, 0 to 1; `matched`, 1 where it was used; `node`, 1 where
        the scan went into the map. Scalars: `nodes`, and `breaks`, where a new map was begun
        because nothing was found again.

        Raises:
            NotApplicableError: no scans, or none with enough points.
        """
        scans = need_scans(view, self.name)
        odometry = odometry_track(view)
        config = self.config.scaled(*scales_of(view))
        local = local_trajectory_of(view, config)
        if not len(local.nodes):
            raise NotApplicableError("no scan has enough points to be matched", where=self.name)
        frame, T_frame_local, start = _placed(view, local, odometry)
        xyyaw = se2.compose(T_frame_local, local.xyyaw)
        xyyaw[: start.row] = np.nan
        cov = drifted(local, start.row, turned(start.cov, -T_frame_local[2]))
        base = view.manifest.frames.base or "base_link"
        track = PoseTrack(frame, base, scans.t_ns, xyyaw, in_frame(T_frame_local, cov))
        matched = np.array([float(fit is not None and fit.accepted) for fit in local.fits])
        node = np.zeros(len(scans))
        node[local.nodes] = 1.0
        return Estimate(
            track,
            (match_innovations(local, frame, float(T_frame_local[2])),),
            {"score": local.scan_score, "matched": matched, "node": node},
            {"nodes": float(len(local.nodes)), "breaks": float(local.is_break.sum())},
        )


def _placed(
    view: BundleView, local: LocalTrajectory, odometry: PoseTrack | None
) -> tuple[str, se2.Array, Start]:
    """Name of the frame, the local frame in it (3,), and the start."""
    frames = view.manifest.frames
    given = starts(view, local.t_ns, local.xyyaw)
    if given and given[0].xyyaw is not None:
        start, frame = given[0], frames.map or "map"
    else:
        row, frame = int(local.nodes[0]), frames.odom or "odom"
        told = None if odometry is None else odometry.at(local.t_ns[row : row + 1]).xyyaw[0]
        zero = local.xyyaw[row] if told is None or not np.isfinite(told).all() else told
        start = Start(row, zero, np.zeros((3, 3)))
    assert start.xyyaw is not None
    return frame, se2.compose(start.xyyaw, se2.inverse(local.xyyaw[start.row])), start
