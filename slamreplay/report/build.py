"""From a post-mortem to report.json's model."""

from __future__ import annotations

from typing import Any

from slamreplay.bundle.findings import Finding
from slamreplay.evidence.result import Postmortem, TrialResult
from slamreplay.report.assess import title_of
from slamreplay.report.build_ledger import jump_parts, ledger_part, trace_part
from slamreplay.report.designs import design_of, design_part
from slamreplay.report.latency import latency_part
from slamreplay.report.model import (
    SCHEMA_VERSION,
    ActionPart,
    BeliefPart,
    BundlePart,
    CandidatePart,
    FailureModePart,
    FindingPart,
    IntervalPart,
    ReferencePart,
    RegionPart,
    Report,
    RootCausePart,
    StopPart,
    TrialPart,
    VerdictPart,
)
from slamreplay.rootcause.result import RootCause
from slamreplay.verdict.judgement import Consumed
from slamreplay.version import __version__

TRAJECTORY_FILE = "hindsight.tum"


def build(post: Postmortem) -> Report:
    """The report's model; pydantic refuses what the schema does not know."""
    judgement, manifest, hindsight = post.judgement, post.manifest, post.hindsight
    mode = judgement.failure_mode
    regions = () if hindsight is None or hindsight.changes is None else hindsight.changes.regions
    map_version = None if post.grid is None else post.grid.version
    return Report(
        schema_version=SCHEMA_VERSION,
        slamreplay=__version__,
        bundle=BundlePart(
            id=manifest.bundle_id,
            sources=[source.name for source in manifest.sources],
            start_ns=manifest.start_ns,
            end_ns=manifest.end_ns,
            clock=manifest.clock.name,
            map_version=map_version,
            missing=manifest.missing_parts(),
        ),
        verdict=VerdictPart(
            state=judgement.state,
            confidence=judgement.confidence,
            summary=judgement.summary,
            lacking=list(judgement.lacking),
        ),
        intervals=[
            IntervalPart(**_picked(i, IntervalPart, findings=list(i.findings)))
            for i in judgement.intervals
        ],
        changed_regions=[
            RegionPart(
                **_picked(
                    r,
                    RegionPart,
                    bbox_m=_bbox(r.bbox_m),
                    from_bbox_m=_from(r),
                    map_version=r.map_version or map_version,
                )
            )
            for r in regions
        ],
        reference=_reference(post),
        failure_mode=FailureModePart(
            kind=mode.kind, confidence=mode.confidence, evidence=list(mode.evidence)
        ),
        root_cause=_root_cause(post.root_cause),
        stops=[StopPart(**_picked(s, StopPart)) for s in judgement.stops],
        actions=[
            ActionPart(**_picked(a, ActionPart, belief=_belief(a.belief)))
            for a in judgement.actions
        ],
        findings=[_finding(f) for f in post.findings],
        trials=[_trial(t) for t in post.trials],
        design=design_part(design_of(post)),
        ledger=ledger_part(post),
        jumps=jump_parts(post),
        trace=trace_part(post),
        latency=latency_part(post),
    )


def _picked(source: object, part: type, **instead: Any) -> dict[str, Any]:
    names = part.model_fields  # type: ignore[attr-defined]
    return {name: instead[name] if name in instead else getattr(source, name) for name in names}


def _belief(consumed: Consumed | None) -> BeliefPart | None:
    if consumed is None:
        return None
    return BeliefPart(**_picked(consumed, BeliefPart, lacks=list(consumed.lacks)))


def _bbox(box: Any) -> tuple[float, ...]:
    return tuple(float(edge) for edge in box)


def _from(region: Any) -> tuple[float, ...] | None:
    return None if region.from_bbox_m is None else _bbox(region.from_bbox_m)


def _reference(post: Postmortem) -> ReferencePart:
    """The trajectory the verdict rests on; another reference in the log only measures it."""
    hindsight = post.hindsight
    if hindsight is None:
        return ReferencePart(kind=post.reference_kind, trajectory=None, sigma_m=None, coverage=None)
    return ReferencePart(
        kind="hindsight",
        trajectory=TRAJECTORY_FILE,
        sigma_m=hindsight.sigma_m,
        coverage=hindsight.coverage,
    )


def _root_cause(cause: RootCause | None) -> RootCausePart | None:
    if cause is None:
        return None
    candidates = [CandidatePart(**_picked(one, CandidatePart)) for one in cause.candidates]
    return RootCausePart(**_picked(cause, RootCausePart, candidates=candidates))


def _finding(finding: Finding) -> FindingPart:
    return FindingPart(**_picked(finding, FindingPart, title=title_of(finding.id)))


def _trial(result: TrialResult) -> TrialPart:
    trial = result.run.trial
    metrics: dict[str, bool | float | None] = dict(result.metrics)
    if result.run.estimate is None:
        metrics = {"not_applicable": True}
    return TrialPart(
        estimator=trial.estimator,
        perturbation=trial.perturbation,
        level=trial.level,
        unit=trial.unit,
        parameters=trial.given,
        metrics=metrics,
    )
