"""The page's tables of what happened, and of trials."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.words import STATES, confidence_text
from slamreplay.report.cells import Cell, Table, table
from slamreplay.report.moments import moment_cell, span_cell
from slamreplay.report.phrases import NOT_KNOWN, number, seconds, short
from slamreplay.verdict.judgement import Consumed

#: The metrics that have a column on the page, as it calls them; report.json has them all.
_COLUMNS = {
    "reference_rmse_m": "rms error [m]",
    "reference_max_m": "max error [m]",
    "hindsight_rmse_m": "rms error [m]",
    "hindsight_max_m": "max error [m]",
    "lost_share": "share lost [1]",
    "baseline_max_m": "from baseline [m]",
    "ate_aligned_m": "rms error, rigidly aligned [m]",
    "nees_mean": "mean NEES [1]",
    "relations_m": "mean error of relations [m]",
    "relations_rad": "and [rad]",
}


def intervals(post: Postmortem, anchors: Mapping[str, str]) -> Table:
    """What held when, and why; `anchors` are those of the findings that the page lists."""
    rows = [
        (
            STATES[i.state].name,
            span_cell(post, i.start_ns, i.end_ns),
            seconds(i.duration_ns),
            confidence_text(i.confidence),
            number(i.max_error_m, ".2f", "m"),
            number(None if i.max_error_rad is None else np.degrees(i.max_error_rad), ".0f", "deg"),
            Cell(
                ", ".join(i.findings) or NOT_KNOWN,
                links=tuple((name, f"#{anchors[name]}") for name in i.findings if name in anchors),
            ),
        )
        for i in post.judgement.intervals
    ]
    head = ("state", "when", "length", "confidence", "off by up to", "heading", "findings")
    return table(head, rows)


def stops(post: Postmortem) -> Table:
    """Unplanned stops."""
    rows = [
        (
            f"{k}",
            moment_cell(post, s.t_ns),
            NOT_KNOWN if s.x_m is None or s.y_m is None else f"{s.x_m:.2f}, {s.y_m:.2f} m",
            STATES[s.state].name,
            s.cause,
        )
        for k, s in enumerate(post.judgement.stops, start=1)
    ]
    return table(("stop", "when", "where (x, y in map)", "state then", "first cause"), rows)


def actions(post: Postmortem) -> Table:
    """Blocked ones first, then those nobody can tell: an allowed motion is no news."""
    order = {False: 0, None: 1, True: 2}
    actions = sorted(post.judgement.actions, key=lambda a: (order[a.allowed], a.t_ns))
    words = {False: "no", None: "unknown", True: "yes"}
    rows = [
        (
            moment_cell(post, a.t_ns),
            a.kind,
            Cell(a.name, "inferred, not recorded" if a.inferred else ""),
            number(a.sigma_m, ".3f", "m"),
            number(a.clearance_m, ".2f", "m"),
            number(a.ratio),
            Cell(words[a.allowed], "needless" if a.needless else ""),
            number(a.error_m, ".2f", "m"),
            _consumed(a.belief),
        )
        for a in actions
    ]
    head = ("when", "kind", "name", "sigma", "clearance", "3 sigma / clearance", "allowed")
    return table((*head, "really off by", "belief it consumed"), rows)


def _consumed(belief: Consumed | None) -> Cell:
    """Frame and age, with what of the contract it lacks under it."""
    if belief is None or belief.frame_id is None:
        return Cell("none", "" if belief is None else belief.consumer)
    age = "" if belief.age_s is None else f", {belief.age_s:.2f} s old"
    version = "" if belief.map_version is None else f", map {belief.map_version[-8:]}"
    lacks = f"; {', '.join(belief.lacks)}" if belief.lacks else ""
    return Cell(f"{belief.frame_id}{age}{version}", f"by {belief.consumer}{lacks}")


def regions(post: Postmortem) -> Table:
    """Changed regions."""
    changes = None if post.hindsight is None else post.hindsight.changes
    regions = () if changes is None else changes.regions
    rows = [
        (
            f"R{k}",
            r.kind,
            "{:.1f}, {:.1f} to {:.1f}, {:.1f} m".format(*r.bbox_m)
            + (
                ""
                if r.from_bbox_m is None
                else " (was at {:.1f}, {:.1f} to {:.1f}, {:.1f} m)".format(*r.from_bbox_m)
            )
            + ("" if r.map_version is None else f" in map {r.map_version[-8:]}"),
            number(r.area_m2, ".2f", "m²"),
            span_cell(post, r.first_seen_ns, r.last_seen_ns),
            f"{r.views}",
            confidence_text(r.confidence),
        )
        for k, r in enumerate(regions, start=1)
    ]
    return table(
        ("region", "what", "where (x, y in map)", "area", "seen", "views", "confidence"), rows
    )


def _interval(metrics: Mapping[str, float | None]) -> str:
    """Where the mean NEES of consistent ones lies in 95 of 100 logs."""
    low, high = metrics.get("nees_low"), metrics.get("nees_high")
    return "" if low is None or high is None else f"chance: {short(low)} to {short(high)}"


def trials(post: Postmortem) -> Table:
    """A row per trial, a column per metric; each perturbed number stands beside its baseline."""
    names = [name for name in _COLUMNS if any(t.metrics.get(name) is not None for t in post.trials)]
    if "reference_rmse_m" in names:  # hindsight stands in for it where the log has none
        names = [name for name in names if not name.startswith("hindsight_")]
    order = list(dict.fromkeys(t.run.trial.estimator for t in post.trials))
    baselines = {
        (t.run.trial.estimator, t.run.trial.parameters, t.run.trial.seed): t.metrics
        for t in post.trials
        if t.run.trial.perturbation is None
    }
    rows: list[list[str | Cell]] = []
    for result in sorted(post.trials, key=lambda t: order.index(t.run.trial.estimator)):
        trial = result.run.trial
        undisturbed = baselines.get((trial.estimator, trial.parameters, trial.seed), {})
        base = {} if trial.perturbation is None else undisturbed
        given = f"{len(trial.given)} parameters given" if trial.given else ""
        cells: list[str | Cell] = [
            Cell(trial.estimator, given),
            trial.perturbation or "baseline",
            NOT_KNOWN if trial.level is None else f"{trial.level:g} {trial.unit}".strip(),
        ]
        for name in names:
            beside = base.get(name) if name != "baseline_max_m" else None
            aside = "" if beside is None else f"baseline {short(beside)}"
            if name == "nees_mean":
                aside = "; ".join(text for text in (_interval(result.metrics), aside) if text)
            cells.append(Cell(short(result.metrics.get(name)), aside))
        if result.run.estimate is None:
            cells[3:] = [Cell("not applicable", result.run.not_applicable or "")]
            cells += [""] * (len(names) - 1)
        rows.append(cells)
    head = ("estimator", "perturbation", "level", *(_COLUMNS[n] for n in names))
    return table(head, rows)
