"""report.json as types: strict, every key always there, null for what is not known.

`report.schema.json` beside this module is printed from these classes (`python -m
slamreplay.report.model` rewrites it; a test keeps the two in step). The file is long because the
schema is: a class for each object, in the order of the file, and nothing that computes.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from slamreplay.bundle.findings import Severity
from slamreplay.bundle.schema import PARTS
from slamreplay.evidence.clean import clean
from slamreplay.verdict.judgement import FailureKind, State

SCHEMA_VERSION: Literal[1] = 1
SCHEMA_FILE = Path(__file__).with_name("report.schema.json")


def _finite(value: Any) -> float | None:
    """JSON has no NaN and no infinity: what is not a finite number is not known."""
    if value is None or not math.isfinite(value):
        return None
    return float(value)


def _whole(value: Any) -> int | None:
    return None if value is None else int(value)


Number = Annotated[float | None, BeforeValidator(_finite)]
Text = Annotated[str, BeforeValidator(clean)]
Count = Annotated[int | None, BeforeValidator(_whole)]
Ns = Annotated[int, BeforeValidator(_whole)]
Share = Annotated[Annotated[float, Field(ge=0.0, le=1.0)] | None, BeforeValidator(_finite)]
Bbox = tuple[float, float, float, float]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class BundlePart(_Strict):
    """The evidence: where it came from, its time range in ns on `clock`, what it lacks."""

    id: str
    sources: list[Text]
    start_ns: Ns
    end_ns: Ns
    clock: Text
    map_version: str | None
    missing: list[str] = Field(json_schema_extra={"items": {"enum": list(PARTS)}})


class VerdictPart(_Strict):
    """The answer, one sentence a shift lead understands, and evidence it had to do without."""

    state: State
    confidence: Share
    summary: Text
    lacking: list[Text]


class IntervalPart(_Strict):
    """A stretch of one state; the intervals tile the log."""

    state: State
    start_ns: Ns
    end_ns: Ns
    confidence: Share
    max_error_m: Number
    max_error_rad: Number
    findings: list[str]


class RegionPart(_Strict):
    """A patch of the map that is not true; boxes are x_min, y_min, x_max, y_max in the map frame.

    `from_bbox_m` is the old place of a moved region, null otherwise. `map_version` is of the map it
    is drawn in: the bundle's, unless the log was given the map of another place on the way.
    """

    kind: Literal["appeared", "removed", "moved"]
    bbox_m: Bbox
    from_bbox_m: Bbox | None
    area_m2: Number
    first_seen_ns: Ns
    last_seen_ns: Ns
    views: Ns
    confidence: Share
    map_version: str | None


class ReferencePart(_Strict):
    """What the belief was judged against; `trajectory` is the file's name beside report.json."""

    kind: Text | None
    trajectory: str | None
    sigma_m: Number
    coverage: Share


class FailureModePart(_Strict):
    """How it failed, and what says so."""

    kind: FailureKind
    confidence: Share
    evidence: list[Text]


class CandidatePart(_Strict):
    """One cause that was tried: `level` of `perturbation`, put into healed evidence at `start_ns`.

    These are null where no perturbation stands for it, where it has no size, where it acted all
    along. `log_likelihood` in nats: only differences mean anything. `text` says what it did.
    """

    kind: FailureKind
    perturbation: str | None
    level: Number
    unit: Text
    start_ns: Count
    log_likelihood: Number
    probability: Share
    text: Text


class RootCausePart(_Strict):
    """Which single thing reproduces what went wrong, the most probable first; null: nothing did.

    `probability` is of `began_as`; `trials` counts replays; `reason` says why nothing was tried.
    """

    start_ns: Ns
    end_ns: Ns
    began_as: FailureKind
    probability: Share
    candidates: list[CandidatePart]
    trials: Ns
    reason: Text


class StopPart(_Strict):
    """An unplanned stop: when, where the robot really was (null: not known), state, first cause."""

    t_ns: Ns
    x_m: Number
    y_m: Number
    state: State
    cause: Text


class BeliefPart(_Strict):
    """The belief an action consumed: null where the log does not tell, `lacks` in words.

    `t_ns` is when the localizer's last word before the action was said, `sigma_xyyaw` in m, m, rad.
    """

    frame_id: str | None
    t_ns: Count
    age_s: Number
    sigma_xyyaw: tuple[float, float, float] | None
    map_version: str | None
    consumer: Text
    lacks: list[Text]


class ActionPart(_Strict):
    """A recovery or motion, and whether the uncertainty of that moment allowed it.

    `sigma_m` is towards the nearest obstacle along its path, `clearance_m` from the footprint's
    edge, `ratio` is 3 sigma over clearance; `allowed` is null where these are not known. `error_m`
    is how far off the belief really was; `needless` of a recovery of a robot that was right.
    `inferred` recoveries were recorded by nobody: motion or a costmap looks like one.
    """

    t_ns: Ns
    kind: Literal["recovery", "motion"]
    name: Text
    sigma_m: Number
    clearance_m: Number
    ratio: Number
    allowed: bool | None
    error_m: Number
    needless: bool | None
    belief: BeliefPart | None
    inferred: bool


class FindingPart(_Strict):
    """A check's answer with its numbers; `slamreplay explain ID` says what it means."""

    id: str
    severity: Severity
    title: Text
    message: Text
    start_ns: Count
    end_ns: Count
    value: Number
    low: Number
    high: Number
    unit: Text
    n: Count
    n_eff: Number
    p_value: Number
    p_adjusted: Number


class TrialPart(_Strict):
    """One estimator run; perturbation and level are null for the baseline.

    `parameters` is what the estimator was given from files, null where it ran with its defaults. A
    trial the estimator could not honour has the one metric `not_applicable`, true.
    """

    estimator: Text
    perturbation: str | None
    level: Number
    unit: Text
    parameters: dict[str, Any] | None
    metrics: dict[str, bool | Number]


class LimitPart(_Strict):
    """A number of a run that counts as broken beyond a value."""

    metric: Text
    at_most: float


class CriticalPart(_Strict):
    """The level at which one metric crosses its limit, null where it does not.

    `low` to `high` hold the median over seeds with `confidence`; of a single seed it is the bracket
    between the last level that held and the first that did not, and `confidence` is null.
    """

    metric: Text
    outcome: Literal["crossed", "partly", "never", "always", "not_applicable"]
    level: Number
    low: Number
    high: Number
    confidence: Number
    crossed: int
    seeds: int


class CurvePart(_Strict):
    """One perturbation of one estimator; `reason` says why there is no curve."""

    estimator: Text
    perturbation: Text
    unit: Text
    baseline: float
    levels: list[float]
    critical: list[CriticalPart]
    broke_first: str | None
    reason: str


class ControlPart(_Strict):
    """A trial whose answer is known beforehand; `passed` is null where it was not applicable."""

    kind: Literal["no_op", "positive"]
    estimator: Text
    perturbation: Text
    level: float
    unit: Text
    passed: bool | None
    text: Text


class MarginPart(_Strict):
    """How far a perturbation could be turned up, as a share of the range tried."""

    estimator: Text
    perturbation: Text
    unit: Text
    metric: str | None
    level: Number
    share: Number


class DesignPart(_Strict):
    """What was changed, how much it took and what broke first; the first limit was searched for."""

    question: Text
    judged_by: str
    seeds: list[int]
    limits: list[LimitPart]
    curves: list[CurvePart]
    controls: list[ControlPart]
    ranking: list[MarginPart]


class LedgerSourcePart(_Strict):
    """One source of one run's ledger: how many rows, and the one that moved the belief most.

    `axes` are names and units of its residual; `mean_nis` is null where S is not what the estimator
    predicted. `largest_*` are null where no row is known to have moved it.
    """

    estimator: Text
    perturbation: str | None
    level: Number
    unit: Text
    seed: Ns
    source: Text
    frame_id: Text
    axes: list[Text]
    rows: Ns
    accepted: Ns
    predicted: bool
    mean_nis: Number
    largest_t_ns: Count
    largest_m: Number
    largest_rad: Number


class LedgerPart(_Strict):
    """What every measurement did: `file` beside report.json has the rows, null without any."""

    file: str | None
    rows: Ns
    sources: list[LedgerSourcePart]


class JumpPart(_Strict):
    """A step of a run's path beyond what odometry tells, and what made it.

    `before_ns` is the last moment before it; `error_*_m` by the best reference, null without one.
    """

    estimator: Text
    perturbation: str | None
    level: Number
    unit: Text
    before_ns: Ns
    t_ns: Ns
    metres: Number
    radians: Number
    cause: Text
    given: bool
    error_before_m: Number
    error_after_m: Number


class TraceRowPart(_Strict):
    """A measurement: what it said, and how far it moved the belief (null: not known).

    `residual` is measured minus predicted in `axes`, `sigma` the square roots of S's diagonal.
    """

    t_ns: Ns
    source: Text
    frame_id: Text
    about: Text
    accepted: bool
    score: Number
    nis: Number
    axes: list[Text]
    residual: list[Number]
    sigma: list[Number]
    moved_m: Number
    moved_rad: Number


class TraceRunPart(_Strict):
    """One run's measurements around the moment, those that moved the belief most first."""

    estimator: Text
    perturbation: str | None
    level: Number
    unit: Text
    rows: list[TraceRowPart]


class TracePart(_Strict):
    """What `--trace` asked for: the measurements within `window_ns` of `t_ns`, else the nearest."""

    t_ns: Ns
    window_ns: Ns
    runs: list[TraceRunPart]


class AgePart(_Strict):
    """Numbers over the uses of a pose, s, m or rad by the key they stand under.

    The interval of p95 is the 95 % one for `n_eff` effective samples, null with too few.
    """

    p50: Number
    p95: Number
    max: Number
    p95_low: Number
    p95_high: Number
    n: Ns
    n_eff: Number


class UsagePart(_Strict):
    """One consumer of the pose; `topic` is null where it was not recorded.

    Then its times are those it would have had at the budget's rate. `pose_s` counts from the moment
    that tf could answer for, `correction_s` from what the localizer's last word speaks of,
    `update_s` from its last new word; `sensing_s`, `answering_s` and `waiting_s` are medians of
    what a correction's age is made of. `unknown_*` is how the robot moved within `pose_s`.
    """

    name: Literal["controller", "planner", "goals", "recoveries"]
    topic: Text | None
    uses: Ns
    rate_hz: Number
    longest_pause_s: Number
    work_s: Number
    budget_hz: Number
    budget_s: Number
    over_share: Share
    over_low: Share
    over_high: Share
    pose_s: AgePart
    correction_s: AgePart
    update_s: AgePart
    sensing_s: Number
    answering_s: Number
    waiting_s: Number
    unknown_m: AgePart
    unknown_rad: AgePart


class LatencyPart(_Strict):
    """How old the pose was when it was used, and how stamps and log times compare.

    `basis`: ages are absolute (shared), longer than told (relative), or count from arrival.
    `dated`: what a correction's age counts from; `ahead_s` is how far its stamps are dated ahead.
    """

    basis: Literal["shared", "relative", "arrival"]
    caveats: list[Text]
    localizer: Text | None
    dated: Literal["scan", "stamp", "arrival"] | None
    ahead_s: Number
    consumers: list[UsagePart]


class Report(_Strict):
    """report.json."""

    schema_version: Literal[1]
    slamreplay: str
    bundle: BundlePart
    verdict: VerdictPart
    intervals: list[IntervalPart]
    changed_regions: list[RegionPart]
    reference: ReferencePart
    failure_mode: FailureModePart
    root_cause: RootCausePart | None
    stops: list[StopPart]
    actions: list[ActionPart]
    findings: list[FindingPart]
    trials: list[TrialPart]
    design: DesignPart | None
    ledger: LedgerPart
    jumps: list[JumpPart]
    trace: TracePart | None
    latency: LatencyPart | None

    def json_text(self) -> str:
        """The file's text; NaN cannot occur in it."""
        return json.dumps(self.model_dump(mode="json"), indent=1, allow_nan=False) + "\n"


def schema_text() -> str:
    """The JSON Schema of report.json."""
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"slamreplay report, schema version {SCHEMA_VERSION}",
        **{k: v for k, v in Report.model_json_schema().items() if k != "title"},
    }
    return json.dumps(schema, indent=1, sort_keys=False) + "\n"


if __name__ == "__main__":
    SCHEMA_FILE.write_text(schema_text(), encoding="utf-8")
