"""What the writers are given: every stage's product, side by side."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slamreplay.bundle.findings import Finding
from slamreplay.bundle.manifest import Manifest
from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.run import Run, Trial
from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.belief.jumps.found import Jump
from slamreplay.consistency.belief.summary import ConsistencySummary
from slamreplay.consistency.evidence.nees import Nees
from slamreplay.estimators import RECORDED
from slamreplay.estimators.pose_graph.product import MapAndGraph
from slamreplay.evidence.ledger import LedgerSet, ledger_sets
from slamreplay.evidence.scene import Scene
from slamreplay.evidence.trace import RunTrace, trace
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import turned
from slamreplay.geometry.times import seconds_since
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.replay.dose import DoseResults
from slamreplay.rootcause.result import RootCause
from slamreplay.verdict.judgement import ConstantOffset, Judgement
from slamreplay.verdict.latency.latency import Latency, Usage
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.reliability import Reliability, measured_reliability


@dataclass(frozen=True, eq=False)
class TrialResult:
    """A run and what it was worth: numbers by name, with the unit in the name."""

    run: Run
    metrics: Mapping[str, float | None] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Postmortem:
    """One log, looked back on.

    Attributes:
        manifest: what the log had and lacked.
        grid: the map at the end, None without one.
        belief: what the robot believed at each scan, None where no localizer spoke.
        hindsight: where it really was, None where that cannot be rebuilt.
        reference: what NEES and trial metrics are measured against, None without any.
        reference_kind: simulation, motion_capture, ... or hindsight.
        judgement: the verdict with its intervals, stops and actions.
        findings: those of the verdict and of every check, worst first.
        limits: the thresholds the verdict was found with.
        odometry: the path by odometry alone, drawn where nothing better is known.
        frame_offset: what the verdict took out of the belief: its map lies elsewhere than this one.
        nees: of the belief at its own updates, None without covariance or reference.
        consistency: the belief's covariance against every source that can tell, the best first.
        trials: perturbation trials, baseline first.
        design: what the trials were laid out by, None where nobody did.
        recorded: the localizer of the log as runs, its ledger with what the log holds near it.
        jumps: of each run, the recorded ones first, the steps of its path and their causes.
        trace_ns: the moment around which is asked what moved the belief, None if nobody asked.
        root_cause: which single thing reproduces what went wrong; None where nothing did, or nobody
            asked.
        latency: how old the pose was whenever it was used, None where that was not asked.
        usages: the same in a few numbers, by consumer.
        scene: what there was to see at each moment; None where nobody asked.
        audit: how clocks and tf of the log hold together, as `slamreplay inspect --json` has it;
            None where nobody looked.
        slam: the map and the graph that the undisturbed run of `pose_graph` made.
        reliability: how often what was said with a confidence was right, as measured.
    """

    manifest: Manifest
    grid: OccupancyGrid | None
    belief: PoseTrack | None
    hindsight: Hindsight | None
    reference: PoseTrack | None
    reference_kind: str | None
    judgement: Judgement
    findings: tuple[Finding, ...]
    limits: Limits
    odometry: PoseTrack | None = None
    frame_offset: ConstantOffset | None = None
    nees: Nees | None = None
    consistency: tuple[ConsistencySummary, ...] = ()
    trials: tuple[TrialResult, ...] = ()
    design: DoseResults | None = None
    recorded: tuple[Run, ...] = ()
    jumps: tuple[tuple[Trial, tuple[Jump, ...]], ...] = ()
    trace_ns: int | None = None
    root_cause: RootCause | None = None
    latency: Latency | None = None
    usages: tuple[Usage, ...] = ()
    scene: Scene | None = None
    audit: Mapping[str, Any] | None = None
    slam: MapAndGraph | None = None
    reliability: Reliability = field(default_factory=measured_reliability)

    def seconds(self, t_ns: ArrayLike) -> se2.Array:
        """Seconds since the log's start, for text and figures."""
        return seconds_since(t_ns, self.manifest.start_ns)

    @cached_property
    def ledger(self) -> tuple[LedgerSet, ...]:
        """What every measurement of every run did, the recorded localizer first."""
        return ledger_sets(self._kept)

    @cached_property
    def traces(self) -> tuple[RunTrace, ...]:
        """What moved the belief of each run around the moment that was asked for."""
        if self.trace_ns is None:
            return ()
        return trace(self._kept, self.trace_ns)

    @property
    def _kept(self) -> list[Run]:
        rerun = [t.run for t in self.trials if t.run.trial.estimator not in RECORDED]
        return [*self.recorded, *rerun]

    @property
    def drawn_from_ns(self) -> int:
        """From when on the log is in the place of its last map: before, nothing fits into that."""
        parts = () if self.hindsight is None else self.hindsight.parts
        return parts[-1].stretch.start_ns if parts else self.manifest.start_ns

    def on_map(self, xyyaw: se2.Array) -> se2.Array:
        """Poses (..., 3) of the localizer's own map frame in that of the map hindsight is told in.

        They differ where the verdict took a constant offset out of the belief.
        """
        if self.frame_offset is None:
            return xyyaw
        return se2.compose(se2.inverse(self.frame_offset.xyyaw), xyyaw)

    @cached_property
    def belief_on_map(self) -> PoseTrack | None:
        """The belief as it is drawn beside hindsight: without that constant offset."""
        belief = self.belief
        if belief is None or self.frame_offset is None:
            return belief
        yaw = -np.full(len(belief), self.frame_offset.xyyaw[2])
        return replace(belief, xyyaw=self.on_map(belief.xyyaw), cov=turned(belief.cov, yaw))

    @cached_property
    def error(self) -> BeliefError | None:
        """Belief against hindsight at the belief's times, None without either.

        As the verdict sees it: without the constant offset of a map frame that lies elsewhere.
        """
        belief = self.belief_on_map
        if belief is None or self.hindsight is None:
            return None
        where = self.hindsight.track.at(belief.t_ns)
        step = belief.xyyaw - where.xyyaw
        return BeliefError(
            belief.t_ns,
            np.hypot(step[:, 0], step[:, 1]),
            np.abs(se2.wrap_angle(step[:, 2])),
            where,
        )


@dataclass(frozen=True, eq=False)
class BeliefError:
    """How far the belief was from hindsight.

    Attributes:
        t_ns: (N,) times.
        distance_m: (N,) m, NaN where either is unknown.
        heading_rad: (N,) rad, not negative.
        where: (N,) hindsight's pose at these times.
    """

    t_ns: NDArray[np.int64]
    distance_m: se2.Array
    heading_rad: se2.Array
    where: PoseTrack
