"""Pose graph SLAM as estimators: over the whole log, and as it would have run on the robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Self

import numpy as np

from slamreplay.bundle.run import Estimate
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.estimators.parameters import settings_from
from slamreplay.estimators.pose_graph.carrying import as_driven, carried, carried_covariances
from slamreplay.estimators.pose_graph.config import GraphConfig
from slamreplay.estimators.pose_graph.ledger import closures_ledger
from slamreplay.estimators.pose_graph.slam import Slam, slam_of
from slamreplay.estimators.scales import MEASUREMENT_NOISE, MIN_SCORE, PROCESS_NOISE
from slamreplay.estimators.scan_matching.ledger import match_innovations
from slamreplay.estimators.start import GLOBAL, MOVED
from slamreplay.geometry import se2

SETTINGS = MOVED | {GLOBAL, MIN_SCORE, PROCESS_NOISE, MEASUREMENT_NOISE}
#: Why the conformance kit cannot make a world that has its noise.
WITHOUT_NOISE = (
    "it learns from the log what scans miss, and allows for errors that neighbouring beams have in "
    "common, which no drawn world has"
)


@dataclass(frozen=True)
class PoseGraph:
    """SLAM with its own map: submaps, loop closures, and a graph of all nodes.

    It begins where the robot's own localizer began, in the map; without a start in a frame of its
    own, from zero. The log's map only makes the start precise; it is not looked at after that.

    Attributes:
        config: hyper-parameters.
    """

    config: GraphConfig = field(default_factory=GraphConfig)

    name: ClassVar[str] = "pose_graph"
    causal: ClassVar[bool] = False
    needs: ClassVar[frozenset[str]] = frozenset({"scans"})
    settings: ClassVar[frozenset[str]] = SETTINGS
    without_noise: ClassVar[str] = WITHOUT_NOISE

    @classmethod
    def from_parameters(cls, given: Mapping[str, object]) -> Self:
        """The estimator with some hyper-parameters set.

        Raises:
            UsageError: one that there is not, or a value that it cannot take.
        """
        return cls(settings_from(GraphConfig, given, where=cls.name))

    def run(self, view: BundleView, *, seed: int) -> Estimate:  # noqa: ARG002 - nothing is random
        """One row per scan, NaN before the first scan that shows anything.

        Diagnostics: `score`, how well each scan fits the map before it. Scalars: what was counted,
        and the typical standard deviation.

        Raises:
            NotApplicableError: no scans, or none with enough points.
        """
        slam = slam_of(view, self.config, self.name, is_online=False)
        assert slam.smoothed is not None
        nodes = slam.smoothed
        xyyaw = carried(slam.local, nodes.xyyaw)
        cov = carried_covariances(slam.local, nodes.xyyaw, nodes.cov)
        more = {
            "closures_switched_off": float((nodes.switches < 0.5).sum()),
            "relations_between_passes": float(len(nodes.passes)),
            "refinements": float(len(nodes.moved_m)),
            "refined_by_m": float(sum(nodes.moved_m)),
        }
        return _estimate(view, slam, xyyaw, cov, more)


@dataclass(frozen=True)
class PoseGraphOnline(PoseGraph):
    """The same closures, each taken in when it was found (iSAM2): nothing later is known."""

    name: ClassVar[str] = "pose_graph_online"
    causal: ClassVar[bool] = True

    def run(self, view: BundleView, *, seed: int) -> Estimate:  # noqa: ARG002 - nothing is random
        """As of `PoseGraph`; NaN before the start, too.

        Raises:
            NotApplicableError: no scans, or none with enough points.
        """
        slam = slam_of(view, self.config, self.name, is_online=True)
        xyyaw, cov = as_driven(slam.local, slam.maps, slam.closed, slam.start)
        xyyaw[: slam.start.row], cov[: slam.start.row] = np.nan, np.nan
        return _estimate(view, slam, xyyaw, cov, {})


def _estimate(
    view: BundleView, slam: Slam, xyyaw: se2.Array, cov: se2.Array, more: Mapping[str, float]
) -> Estimate:
    local = slam.local
    base = view.manifest.frames.base or "base_link"
    track = PoseTrack(slam.start.frame_id, base, local.t_ns, xyyaw, cov)
    closures = closures_ledger(slam)
    scalars = {
        "start_score": slam.start.on_map,
        "nodes": float(len(local.nodes)),
        "breaks": float(local.is_break.sum()),
        "submaps": float(len(slam.maps)),
        "closures_found": float(len(closures.t_ns)),
        "closures_accepted": float(closures.accepted.sum()),
        **more,
    }
    return Estimate(
        track, (match_innovations(local), closures), {"score": local.scan_score}, scalars
    )
