"""Links from the page to a moment of its replay, and to its findings."""

from __future__ import annotations

from slamreplay.evidence.result import Postmortem
from slamreplay.geometry.times import NS_PER_S
from slamreplay.report.cells import Cell
from slamreplay.report.phrases import seconds, span


def moment_link(post: Postmortem, t_ns: int | None) -> str:
    """Where the replay shows it: seconds since the log's start; empty where nothing can be shown.

    Before the first and after the last moment of the log there is nothing to see.
    """
    manifest = post.manifest
    if post.scene is None or t_ns is None or not manifest.start_ns <= t_ns <= manifest.end_ns:
        return ""
    return f"#t={(t_ns - manifest.start_ns) / NS_PER_S:.2f}".rstrip("0").rstrip(".")


def moment_cell(post: Postmortem, t_ns: int) -> Cell:
    """A cell with a moment's time."""
    return _cell(post, seconds(t_ns - post.manifest.start_ns), t_ns)


def span_cell(post: Postmortem, start_ns: int, end_ns: int) -> Cell:
    """A cell with a stretch of time; its link leads to where it begins."""
    return _cell(post, span(post, start_ns, end_ns), start_ns)


def _cell(post: Postmortem, text: str, t_ns: int) -> Cell:
    link = moment_link(post, t_ns)
    return Cell(text, links=((text, link),) if link else ())
