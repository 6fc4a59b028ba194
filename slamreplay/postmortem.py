"""One log in, one post-mortem out: the composition that every command calls."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

from slamreplay.bundle.belief import belief_times, recorded_belief
from slamreplay.bundle.findings import SEVERITIES, Finding
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.run import Run, Trial
from slamreplay.bundle.view import Bundle, BundleView
from slamreplay.consistency.answers import raised
from slamreplay.consistency.asking import answered
from slamreplay.consistency.audits.inspection import clock_and_frames
from slamreplay.consistency.belief.credibility import nees_of_belief
from slamreplay.consistency.belief.jumps.found import jumps_of
from slamreplay.consistency.belief.jumps.log_events import with_subjects
from slamreplay.consistency.belief.summary import consistency_summaries
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence.references import references_of, unused_references
from slamreplay.consistency.evidence.sensed import sensed_references
from slamreplay.estimators import ESTIMATORS, RECORDED
from slamreplay.estimators.pose_graph.estimator import PoseGraph
from slamreplay.estimators.pose_graph.product import MapAndGraph, map_and_graph
from slamreplay.estimators.recorded import recorded_names
from slamreplay.evidence.result import Postmortem, TrialResult
from slamreplay.evidence.scene_of import scene_of
from slamreplay.hindsight.pipeline import hindsight
from slamreplay.replay.dose import DoseResults
from slamreplay.replay.metrics import trial_metrics
from slamreplay.replay.parameters import configured
from slamreplay.report.metrics import asked_of, run_metrics
from slamreplay.rootcause.answer import root_cause
from slamreplay.rootcause.mode import mode_of
from slamreplay.verdict.judge import judge
from slamreplay.verdict.latency.findings import late_findings
from slamreplay.verdict.latency.latency import latency, usages
from slamreplay.verdict.limits import Limits

__all__ = ["Postmortem", "postmortem"]

#: Share of the progress bar that hindsight takes: nearly all the time goes there.
_HINDSIGHT_SHARE = 0.9


def postmortem(
    bundle: Bundle,
    runs: Sequence[Run] = (),
    *,
    limits: Limits | None = None,
    hold_out: Collection[str] = (),
    correct_map: bool = False,
    trace_ns: int | None = None,
    design: DoseResults | None = None,
    cause: bool = True,
    scene: bool = True,
    progress: Callable[[str, float], None] | None = None,
) -> Postmortem:
    """Look back on one log.

    Hindsight and verdict get the view, in which references that only judge are hidden; NEES and
    trial metrics are measured against the best reference of the bundle.

    Args:
        bundle: the log.
        runs: trials on the same bundle, to be laid beside each other.
        limits: thresholds of the verdict; the defaults are design's.
        hold_out: kinds of sensed references (fiducial, dock, gnss) that judge hindsight instead of
            joining it.
        correct_map: propose a corrected map, too.
        design: what the runs were laid out by, where it was a recipe.
        trace_ns: a moment around which to tell which measurements moved the belief.
        cause: replay what went wrong with one thing put right at a time.
        scene: lay out what there was to see at each moment, for a page or an export.
        progress: told what is being done, and the share done from 0 to 1.
    """
    limits = Limits() if limits is None else limits
    say = progress or (lambda _what, _share: None)
    view = bundle.view(hold_out)
    found = hindsight(
        view,
        correct_map=correct_map,
        progress=lambda what, share: say(what, _HINDSIGHT_SHARE * share),
    )
    say("verdict", _HINDSIGHT_SHARE)
    belief = recorded_belief(view, belief_times(view))
    judgement = judge(view, belief, found, limits)
    began = None
    if cause:
        say("root cause", 0.92)
        began = root_cause(view, belief, found, limits)
    if began is not None:
        mode = mode_of(began, judgement.failure_mode)
        if mode.kind == judgement.failure_mode.kind:
            judgement = replace(judgement, failure_mode=mode)
        else:  # the summary and the stops tell of it, too
            judgement = judge(view, belief, found, limits, mode)
    say("checks", 0.95)
    references = references_of(bundle, found)
    context = CheckContext(belief, references, view)
    best = context.reference
    reference, kind = (None, None) if best is None else (best.track, best.kind)
    findings = [*judgement.findings, *unused_references(bundle, context.updates)]
    findings += sensed_references(bundle, found, hold_out)
    late = latency(view, streams=context.audit.streams)
    used = usages(late)
    findings += late_findings(late, used, limits)
    of_runs = [asked_of(run, references, view) for run in runs]
    # What the localizer said was asked already, as the robot's own belief.
    rerun = [
        asked
        for asked, run in zip(of_runs, runs, strict=True)
        if not run.trial.perturbation and run.trial.estimator not in RECORDED
    ]
    answers = answered([context, *rerun])
    findings += raised(answers)
    track = None if found is None else found.track
    trials = tuple(
        TrialResult(
            run,
            {
                **trial_metrics(run, runs, bundle),
                **run_metrics(run, track, asked, limits),
            },
        )
        for run, asked in zip(runs, of_runs, strict=True)
    )
    recorded = _recorded(view)
    everybody = [(run, asked_of(run, references, view)) for run in recorded]
    everybody += [
        (run, asked)
        for run, asked in zip(runs, of_runs, strict=True)
        if run.trial.estimator not in RECORDED
    ]
    slam = _slam(bundle, runs)
    post = Postmortem(
        slam=slam,
        manifest=bundle.manifest,
        grid=view.grid,
        belief=belief,
        hindsight=found,
        reference=reference,
        reference_kind=kind,
        judgement=judgement,
        findings=_worst_first(findings),
        limits=limits,
        odometry=odometry_track(view),
        frame_offset=judgement.frame_offset,
        nees=nees_of_belief(context),
        consistency=consistency_summaries(context, answers),
        trials=trials,
        design=design,
        recorded=recorded,
        jumps=tuple((asked_run.trial, jumps_of(asked)) for asked_run, asked in everybody),
        trace_ns=trace_ns,
        root_cause=began,
        latency=late,
        usages=used,
        audit=clock_and_frames(context.audit),
    )
    if scene:
        say("scene", 0.98)
        post = replace(post, scene=scene_of(post, view))
    say("done", 1.0)
    return post


def _recorded(view: BundleView) -> tuple[Run, ...]:
    """The localizer of the log as runs, in its ledger what the log holds near each of its words."""
    runs = []
    for name in recorded_names(view):
        estimate = ESTIMATORS.load(name)().run(view, seed=0)
        told = tuple(with_subjects(one, view) for one in estimate.innovations)
        trial = Trial(view.manifest.bundle_id, name, 0)
        runs.append(Run(trial, replace(estimate, innovations=told)))
    return tuple(runs)


def _slam(bundle: Bundle, runs: Sequence[Run]) -> MapAndGraph | None:
    """The map and the graph behind the first undisturbed run of the pose graph, made again.

    A run keeps poses and ledger only: the points of all scans would make it ten times as large.
    """
    for run in runs:
        trial = run.trial
        if trial.estimator == PoseGraph.name and not trial.perturbation and run.estimate:
            estimator = configured(trial.estimator, trial.parameters)
            return map_and_graph(bundle.view(), estimator.config)
    return None


def _worst_first(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """By severity; within one severity the verdict's own come first, then in the checks' order."""
    unique = list(dict.fromkeys(findings))
    return tuple(sorted(unique, key=lambda f: -SEVERITIES.index(f.severity)))
