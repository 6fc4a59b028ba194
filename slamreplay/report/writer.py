"""A report on disk: a folder that is whole or absent."""

from __future__ import annotations

from pathlib import Path

from slamreplay.bundle.atomic import atomic_folder
from slamreplay.bundle.tum import tum
from slamreplay.evidence.ledger import LEDGER_FILE, ledger_bytes
from slamreplay.evidence.result import Postmortem
from slamreplay.report import REPORT_FILE
from slamreplay.report.build import TRAJECTORY_FILE, build
from slamreplay.report.changed_map import changed_files
from slamreplay.report.freshness_file import FRESHNESS_FILE, freshness_bytes
from slamreplay.report.html import html
from slamreplay.report.junit import junit_xml


def write_report(post: Postmortem, target: Path) -> Path:
    """Write report.html, report.json, junit.xml; the ledger where one was kept.

    With a map also trajectory, changes and freshness.

    Args:
        post: the post-mortem; the same one gives the same bytes.
        target: folder; a report that is there already is replaced in one step.

    Returns:
        The path of report.html.

    Raises:
        OutputError: the folder is somebody else's or cannot be written.
    """
    content = {
        REPORT_FILE: build(post).json_text().encode(),
        "report.html": html(post).encode(),
        "junit.xml": junit_xml(post).encode(),
    }
    if post.ledger:
        content[LEDGER_FILE] = ledger_bytes(post.ledger, clock=post.manifest.clock.name)
    if post.hindsight is not None:
        content[TRAJECTORY_FILE] = tum(post.hindsight.track).encode()
    if post.grid is not None:
        changes = None if post.hindsight is None else post.hindsight.changes
        content |= changed_files(post.grid, changes)
        if changes is not None and changes.freshness is not None:
            frame, clock = post.grid.frame_id, post.manifest.clock.name
            content[FRESHNESS_FILE] = freshness_bytes(changes.freshness, frame=frame, clock=clock)
    with atomic_folder(target, marker=REPORT_FILE) as work:
        for name, data in content.items():
            (work / name).write_bytes(data)
    return target / "report.html"
