"""The page's table of causes that were tried."""

from __future__ import annotations

from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.words import FAILURE_MODES, confidence_text
from slamreplay.report.cells import Cell, Table, table
from slamreplay.report.moments import moment_cell
from slamreplay.report.phrases import seconds
from slamreplay.rootcause.result import Candidate

_HEAD = ("began as", "what was put back", "how much", "from", "what it did", "probability")


def causes(post: Postmortem) -> Table:
    """Every cause that was tried, the most probable first; no rows where none was."""
    cause = post.root_cause
    if cause is None or not cause.trials:
        return table(_HEAD, [])
    return table(_HEAD, [_row(one, post) for one in cause.candidates])


def _row(one: Candidate, post: Postmortem) -> tuple[str | Cell, ...]:
    much = "" if one.level is None else f"{one.level:.3g} {one.unit}".replace(" ratio", "")
    since = Cell("all along") if one.start_ns is None else moment_cell(post, one.start_ns)
    name = "no single thing" if one.kind == "none" else FAILURE_MODES[one.kind]
    return name, one.perturbation or "", much, since, one.text, confidence_text(one.probability)


def cause_note(post: Postmortem) -> str:
    """What the table is, or why there is none; empty where nothing went wrong."""
    cause = post.root_cause
    if cause is None:
        return ""
    if not cause.trials:
        why = f": {cause.reason}" if cause.reason else ""
        return f"Nothing was replayed{why}; what is said of the cause was read off the evidence."
    since = seconds(cause.start_ns - post.manifest.start_ns)
    return (
        f"The evidence around {since} was put right by hindsight: odometry, stamps, scans, map and "
        f"start. Then one thing at a time was put back as the log has it, and a particle filter "
        f"with Nav2's defaults was run on it, {cause.trials} times in all. What leads the belief "
        "astray as it was seen is probable; the probabilities are calibrated on simulated "
        "incidents of known cause." + (f" But {cause.reason}." if cause.reason else "")
    )
