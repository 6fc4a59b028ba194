"""The verdict and what it rests on: the types that the report prints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from slamreplay.bundle.findings import Finding

State = Literal[
    "healthy", "lost", "map_changed", "lost_and_map_changed", "unobservable", "insufficient_data"
]
STATES: tuple[State, ...] = (
    "healthy",
    "lost",
    "map_changed",
    "lost_and_map_changed",
    "unobservable",
    "insufficient_data",
)
#: Of these nothing was decided.
UNDECIDED: tuple[State, ...] = ("unobservable", "insufficient_data")

FailureKind = Literal[
    "sensing_ambiguity",
    "association_error",
    "optimization_drift",
    "stale_map_use",
    "timing",
    "odometry_slip",
    "wrong_initial_pose",
    "kidnapped",
    "overconfidence",
    "wrong_map",
    "none",
]


@dataclass(frozen=True)
class Interval:
    """A stretch [start_ns, end_ns) of one state.

    Attributes:
        confidence: that the state is the right one, None where nothing was decided; see
            `confidence` for how it was calibrated.
        max_error_m: largest distance between belief and hindsight in it, None where unknown.
        max_error_rad: largest difference in heading, rad.
        findings: ids of the findings that made the state.
    """

    state: State
    start_ns: int
    end_ns: int
    confidence: float | None = None
    max_error_m: float | None = None
    max_error_rad: float | None = None
    findings: tuple[str, ...] = ()

    @property
    def duration_ns(self) -> int:
        """How long it lasted."""
        return self.end_ns - self.start_ns

    @property
    def is_lost(self) -> bool:
        """Whether the robot was lost in it."""
        return self.state in ("lost", "lost_and_map_changed")

    @property
    def is_changed(self) -> bool:
        """Whether the map was contradicted in it."""
        return self.state in ("map_changed", "lost_and_map_changed")


@dataclass(frozen=True)
class FailureMode:
    """How it began to fail, with the sentences that say so."""

    kind: FailureKind
    confidence: float | None
    evidence: tuple[str, ...]


@dataclass(frozen=True)
class Stop:
    """An unplanned stop.

    Attributes:
        x_m: where the robot really was in the map frame, else where it believed to be; None where
            neither is known.
        state: of the interval it fell into.
        cause: first cause, in one sentence.
    """

    t_ns: int
    x_m: float | None
    y_m: float | None
    state: State
    cause: str


@dataclass(frozen=True)
class Consumed:
    """The belief that an action was built on: the contract, as far as the log tells it.

    Attributes:
        frame_id: frame of the pose, None where there was no belief.
        t_ns: when the localizer's last word before the action was said; None without one.
        age_s: how old it was when the action began.
        sigma_xyyaw: its standard deviations in m, m, rad; None without a covariance.
        map_version: version of the map that held then; None where the log does not tell.
        consumer: who acted on it: topic or behaviour.
        lacks: what of the contract is missing or stale, in words.
    """

    frame_id: str | None
    t_ns: int | None
    age_s: float | None
    sigma_xyyaw: tuple[float, float, float] | None
    map_version: str | None
    consumer: str
    lacks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Action:
    """A recovery or a motion, and whether the uncertainty of that moment allowed it.

    Attributes:
        sigma_m: standard deviation of the position towards the nearest obstacle along its path.
        clearance_m: from the footprint's edge to that obstacle.
        ratio: 3 sigma over clearance; None where either is unknown or there is no clearance left.
        allowed: whether 3 sigma fit into the clearance; None where that is unknown.
        error_m: how far the belief really was from hindsight then, None where unknown.
        needless: of a recovery, whether the robot was right about where it was in a map that was
            right; None where unknown, of motions, and of recoveries that are inferred.
        belief: what it was built on, None where it was not looked up.
        inferred: whether it is a recovery that nobody recorded, inferred from motion or costmaps.
    """

    t_ns: int
    kind: Literal["recovery", "motion"]
    name: str
    sigma_m: float | None
    clearance_m: float | None
    ratio: float | None
    allowed: bool | None
    error_m: float | None = None
    needless: bool | None = None
    belief: Consumed | None = None
    inferred: bool = False


Cause = Literal["map", "map_or_start", "lookalike"]


@dataclass(frozen=True)
class ConstantOffset:
    """Belief = offset after hindsight, all along.

    Attributes:
        xyyaw: (3,) the transform, in the map frame: m, m, rad.
        at_robot_m: median distance it makes where the robot was.
        at_robot_rad: its turn.
        spread_m: nine of ten rows stay within this of it.
        cause: map, map_or_start (both explain it equally) or lookalike (the robot was lost).
    """

    xyyaw: tuple[float, float, float]
    at_robot_m: float
    at_robot_rad: float
    spread_m: float
    cause: Cause

    @property
    def text(self) -> str:
        """The offset in words."""
        turn = np.degrees(self.xyyaw[2])
        return f"x {self.xyyaw[0]:+.2f} m, y {self.xyyaw[1]:+.2f} m, {turn:+.1f} deg"


@dataclass(frozen=True)
class Judgement:
    """One log's verdict.

    Attributes:
        state: of the log as a whole.
        confidence: that it is the right one, never 1; None where nothing was decided.
        summary: one sentence a shift lead understands.
        intervals: tile the log without gap or overlap.
        failure_mode: how it began.
        stops: every unplanned stop, in time order.
        actions: recoveries and motions, in time order.
        findings: what made the verdict, worst first.
        frame_offset: what was taken out of the belief because the map lies elsewhere than the
            robot's own; None where nothing was.
        lacking: evidence the verdict had to do without, each with what it leaves open.
    """

    state: State
    confidence: float | None
    summary: str
    intervals: tuple[Interval, ...]
    failure_mode: FailureMode
    stops: tuple[Stop, ...]
    actions: tuple[Action, ...]
    findings: tuple[Finding, ...]
    frame_offset: ConstantOffset | None = None
    lacking: tuple[str, ...] = ()
