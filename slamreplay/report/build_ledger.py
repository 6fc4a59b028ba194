"""The residual ledger, jumps and traces in report.json's model."""

from __future__ import annotations

from typing import Any

from slamreplay.bundle.run import Trial
from slamreplay.evidence.ledger import LEDGER_FILE, LedgerSet
from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.trace import WINDOW_NS, Traced
from slamreplay.report.model import (
    JumpPart,
    LedgerPart,
    LedgerSourcePart,
    TracePart,
    TraceRowPart,
    TraceRunPart,
)


def ledger_part(post: Postmortem) -> LedgerPart:
    """What the file of the ledger holds."""
    return LedgerPart(
        file=LEDGER_FILE if post.ledger else None,
        rows=sum(len(one) for one in post.ledger),
        sources=[_source(one) for one in post.ledger],
    )


def jump_parts(post: Postmortem) -> list[JumpPart]:
    """Every jump of every run."""
    return [
        JumpPart(
            **_trial(trial),
            before_ns=jump.step.before_ns,
            t_ns=jump.step.t_ns,
            metres=jump.step.metres,
            radians=jump.step.radians,
            cause=jump.cause,
            given=jump.is_given,
            error_before_m=jump.error_before_m,
            error_after_m=jump.error_after_m,
        )
        for trial, found in post.jumps
        for jump in found
    ]


def trace_part(post: Postmortem) -> TracePart | None:
    """What was asked for, None where nothing was."""
    if post.trace_ns is None:
        return None
    runs = [
        TraceRunPart(**_trial(one.trial), rows=[_row(traced) for traced in one.rows])
        for one in post.traces
    ]
    return TracePart(t_ns=post.trace_ns, window_ns=WINDOW_NS, runs=runs)


def _trial(trial: Trial) -> dict[str, Any]:
    return {
        "estimator": trial.estimator,
        "perturbation": trial.perturbation,
        "level": trial.level,
        "unit": trial.unit,
    }


def _source(one: LedgerSet) -> LedgerSourcePart:
    seen, row = one.set, one.largest
    most = None if row is None else Traced(seen, row)
    return LedgerSourcePart(
        **_trial(one.trial),
        seed=one.trial.seed,
        source=seen.source,
        frame_id=seen.frame_id,
        axes=list(seen.axes),
        rows=len(one),
        accepted=int(seen.accepted.sum()),
        predicted=seen.is_predicted,
        mean_nis=one.mean_nis,
        largest_t_ns=None if most is None else most.t_ns,
        largest_m=None if most is None else most.metres,
        largest_rad=None if most is None else most.radians,
    )


def _row(one: Traced) -> TraceRowPart:
    seen, row = one.set, one.row
    return TraceRowPart(
        t_ns=one.t_ns,
        source=seen.source,
        frame_id=seen.frame_id,
        about=str(seen.about[row]),
        accepted=bool(seen.accepted[row]),
        score=float(seen.score[row]),
        nis=one.nis,
        axes=list(seen.axes),
        residual=[float(value) for value in seen.residual[row]],
        sigma=list(one.sigma),
        moved_m=one.metres,
        moved_rad=one.radians,
    )
