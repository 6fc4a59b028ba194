"""One log held against a gate's demands: what the commands gate, batch and watch all call."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from pathlib import Path

from slamreplay.bundle.run import Run, Trial
from slamreplay.bundle.view import Bundle
from slamreplay.evidence.result import Postmortem
from slamreplay.gate.assessable import unasked
from slamreplay.gate.finding_checks import expected, forbidden, severity
from slamreplay.gate.limit_checks import limited
from slamreplay.gate.measures import Measures
from slamreplay.gate.measuring import measures_of
from slamreplay.gate.outcome import GatedLog, Outcome
from slamreplay.gate.rules import Demands, Rules
from slamreplay.replay.runner import replay


def gated(
    post: Postmortem,
    demands: Demands,
    log: str,
    *,
    measures: Measures | None = None,
    cause: bool = True,
    failed_before: Collection[str] = (),
    report: str | None = None,
) -> GatedLog:
    """What the gate says of one log.

    Args:
        post: the log, looked back on; with the runs of `runs_of` where there are any.
        demands: of the recipe.
        log: its path with forward slashes: it chooses the rules, and CI shows it.
        measures: those of the post-mortem, where somebody has them already.
        cause: whether root causes were looked for.
        failed_before: ids of checks that failed in this log when the baseline was made.
        report: folder of its report beside the gate's files.
    """
    measures = measures_of(post) if measures is None else measures
    rules = demands.rules_of(log)
    outcomes = [*checked(rules, post, measures, cause=cause, failed_before=failed_before)]
    if rules.require_assessable and outcomes and all(o.status == "skipped" for o in outcomes):
        outcomes.append(_nothing(outcomes))
    judgement = post.judgement
    return GatedLog(
        log,
        judgement.state,
        judgement.summary,
        post.manifest.start_ns,
        tuple(outcomes),
        report,
    )


def checked(
    rules: Rules,
    post: Postmortem,
    measures: Measures,
    *,
    cause: bool = True,
    failed_before: Collection[str] = (),
) -> tuple[Outcome, ...]:
    """Every rule's outcome: what must be there, what must not, the severity, the limits."""
    why_not = unasked(post, measures)
    outcomes = [
        *expected(rules.expect, post, why_not, cause=cause),
        *forbidden(rules.forbid, rules.expect, post, why_not, cause=cause),
    ]
    if rules.max_severity is not None:
        outcomes += severity(rules.max_severity, rules.expect, post)
    return *outcomes, *limited(rules.limits, measures, failed_before)


def unread(log: str, why: str) -> GatedLog:
    """A log that could not be read or looked back on, with the line that says why."""
    outcome = Outcome("read", "the log can be read", "error", "error", why)
    return GatedLog(log, None, why, None, (outcome,))


def runs_of(
    demands: Demands,
    bundle: Bundle,
    *,
    progress: Callable[[str, float], None] | None = None,
    cache: Path | None = None,
    workers: int | None = None,
) -> list[Run]:
    """The runs that limits are about: each estimator of the demands, undisturbed, with each seed.

    Args:
        demands: of the recipe.
        bundle: the log.
        progress: as of `replay`.
        cache: as of `replay`.
        workers: as of `replay`.
    """
    trials = [
        Trial(bundle.manifest.bundle_id, name, seed)
        for name in demands.estimators
        for seed in range(demands.seeds)
    ]
    if not trials:
        return []
    return replay(bundle, trials, progress=progress, cache=cache, workers=workers)


def _nothing(outcomes: Sequence[Outcome]) -> Outcome:
    first = outcomes[0].message
    return Outcome(
        "assessable",
        "something can be assessed",
        "failed",
        "error",
        f"none of {len(outcomes)} checks could be assessed; the first: {first}",
    )
