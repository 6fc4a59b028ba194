"""What stands under a figure in a paper or a ticket: what is shown, of which log, in numbers."""

from __future__ import annotations

import numpy as np

from slamreplay.consistency.belief.summary import PartSummary
from slamreplay.evidence.clean import clean
from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.words import FAILURE_MODES, STATES, confidence_text
from slamreplay.geometry.times import NS_PER_S
from slamreplay.report.designs import design_of
from slamreplay.report.dose_tables import level_text, panel_of
from slamreplay.report.figures.doses import response_label
from slamreplay.report.figures.map import NAMED
from slamreplay.report.phrases import graph_alt, map_note, reference_note, seconds, short
from slamreplay.version import __version__

#: So many curves of a design are told in numbers; the report has them all.
_CURVES = 6


def provenance(post: Postmortem) -> str:
    """Which log, and by which program: the last sentence of every caption."""
    manifest = post.manifest
    names = [source.name for source in manifest.sources] or ["no file"]
    log = names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"
    length = seconds(manifest.end_ns - manifest.start_ns)
    told = f"Log {log}, {length}; slamreplay {__version__}, bundle {manifest.bundle_id}."
    return clean(told)


def map_caption(post: Postmortem) -> str:
    """Both paths, where they part, regions, stops and the verdict."""
    error, hindsight = post.error, post.hindsight
    told = []
    if error is None or not np.isfinite(error.distance_m).any():
        told.append("Path of the robot, as far as the log tells it.")
    else:
        worst = int(np.nanargmax(error.distance_m))
        at_s = float(post.seconds(error.t_ns[worst]))
        told.append(
            "Path that the robot believed (dashed) and path rebuilt in hindsight (solid), "
            f"{error.distance_m[worst]:.2f} m apart at worst, at {at_s:.1f} s."
        )
    told.append(_offset(post))
    changes = None if hindsight is None else hindsight.changes
    if changes is not None and changes.regions:
        count, area = len(changes.regions), sum(region.area_m2 for region in changes.regions)
        many = "1 changed region" if count == 1 else f"{count} changed regions"
        named = "R1" if count == 1 else f"R1 to R{min(count, NAMED)} by size"
        told.append(f"{many} ({named}), {area:.1f} m² in all.")
    if post.judgement.stops:
        told.append("Numbers mark unplanned stops.")
    return " ".join([*told, map_note(post), _verdict(post), _hindsight(post)])


def course_caption(post: Postmortem) -> str:
    """Errors and changed beams, and how long each was beyond its limit."""
    limits, intervals = post.limits, post.judgement.intervals
    told = []
    if post.error is not None:
        lost_s = sum(i.duration_ns for i in intervals if i.is_lost) / NS_PER_S
        told.append(
            "Distance and heading of the belief from hindsight over time; beyond "
            f"{limits.position_m:g} m or {np.degrees(limits.yaw_rad):.0f} deg for "
            f"{limits.lost_s:g} s (dashed) the robot counts as lost, here for {lost_s:.1f} s."
        )
        told.append(_offset(post))
    if post.hindsight is not None and post.hindsight.changes is not None:
        changed_s = sum(i.duration_ns for i in intervals if i.is_changed) / NS_PER_S
        told.append(
            "Share of the valid beams that contradict the map when cast from hindsight's pose; "
            f"above {100 * limits.changed_share:g} % for {limits.changed_s:g} s the map counts as "
            f"changed, here for {changed_s:.1f} s."
        )
    return " ".join([*told, "Bands are states of the verdict.", _verdict(post), _hindsight(post)])


def covariance_caption(post: Postmortem) -> str:
    """Ellipses, claimed against real error, NEES with its interval."""
    text = (
        "Covariance of the belief: 3-sigma ellipses along its path, and 3 sigma of the position "
        "along its worst direction over time."
    )
    told = [text]
    test = None if post.nees is None else post.nees.summary().test
    if test is not None and test.mean is not None:
        assert test.low is not None
        assert test.high is not None
        told.append(
            f"NEES of x, y, yaw at the belief's own updates: mean {short(test.mean)} "
            f"(n = {test.n}, n_eff = {test.n_eff:.1f}), {test.dof} expected, "
            f"95 % of consistent beliefs within {short(test.low)} to {short(test.high)}."
        )
    return " ".join([*told, reference_note(post)])


def consistency_caption(post: Postmortem) -> str:
    """The distribution of squared errors of the first source, in numbers."""
    first = post.consistency[0]
    shared = ", which shares evidence with the belief" if first.shared else ""
    text = (
        "Distribution function of chi-square at the squared whitened errors (PIT), flat where the "
        "covariance is right, and the share of errors that ellipses of each probability hold. "
        f"Errors against {first.source}{shared}."
    )
    told = [text, *(_part(part) for part in first.parts if part.mean.mean is not None)]
    return " ".join(told)


def doses_caption(post: Postmortem) -> str:
    """The question and how much it took, curve by curve."""
    results = design_of(post)
    assert results is not None
    limit = results.limits[0]
    label = " ".join(response_label(limit).split())
    seeds = f"{len(results.seeds)} seed{'' if len(results.seeds) == 1 else 's'}"
    text = (
        f"{results.question} {label[0].upper()}{label[1:]} against the level of one "
        f"perturbation at a time; limit: {limit.title}; judged by {results.judged_by}; {seeds}."
    )
    told = [text]
    curves = [curve for curve in results.curves if not curve.reason]
    for curve in curves[:_CURVES]:
        took = level_text(curve.critical[0])
        told.append(f"{curve.estimator}, {panel_of(curve)} [{curve.unit}]: {took}.")
    if len(curves) > _CURVES:
        told.append(f"{len(curves) - _CURVES} more curves in report.json.")
    return " ".join(told)


def graph_caption(post: Postmortem) -> str:
    """The pose graph's map, nodes and closures."""
    assert post.slam is not None
    return f"{graph_alt(post)} Undisturbed run of pose_graph, in frame {post.slam.frame_id}."


def reliability_caption(post: Postmortem) -> str:
    """What confidence is worth."""
    record, said = post.reliability, post.judgement.confidence
    ece = "" if record.ece is None else f", expected calibration error {short(record.ece)}"
    here = "" if said is None else f" This log's verdict is said with {confidence_text(said)}."
    return (
        "Reliability diagram: share of moments whose state was the true one against the confidence "
        f"it was said with; {record.moments:,} moments of {record.logs} simulated logs that "
        f"nothing was tuned on{ece}.{here}"
    )


def cause_caption(post: Postmortem) -> str:
    """Which single thing reproduces what went wrong."""
    cause = post.root_cause
    assert cause is not None
    best = cause.candidates[0]
    text = best.text if best.text.endswith(".") else f"{best.text}."
    return (
        "Probability of each single cause to reproduce what went wrong, put back one at a time "
        f"into evidence healed by hindsight; {cause.trials} replays. Began as "
        f"{FAILURE_MODES[cause.began_as]} ({confidence_text(cause.probability)}): {text}"
    )


def _verdict(post: Postmortem) -> str:
    state, confidence = post.judgement.state, post.judgement.confidence
    sure = "" if confidence is None else f", confidence {confidence_text(confidence)}"
    return f"Verdict: {STATES[state].name.lower()}{sure}."


def _offset(post: Postmortem) -> str:
    if post.frame_offset is None or post.error is None:
        return ""
    return "The constant offset between the robot's map frame and this one is taken out of errors."


def _hindsight(post: Postmortem) -> str:
    found = post.hindsight
    if found is None or not np.isfinite(found.sigma_m):
        return ""
    return (
        f"Hindsight places {100 * found.coverage:.0f} % of the scans, within "
        f"{100 * found.sigma_m:.1f} cm (1 sigma)."
    )


def _part(part: PartSummary) -> str:
    mean = part.mean
    k = "" if mean.ratio is None else f", k = {short(mean.ratio)}"
    few = "" if mean.sufficient else ": too few independent ones to decide"
    within = "" if mean.low is None else f"; 95 % within {short(mean.low)} to {short(mean.high)}"
    return (
        f"{part.name.capitalize()}: mean NEES {short(mean.mean)} ({mean.dof} expected{within}), "
        f"n = {mean.n}, n_eff = {mean.n_eff:.1f}{k}{few}."
    )
