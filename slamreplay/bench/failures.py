"""The full report of a log that was judged otherwise than the truth has it."""

from __future__ import annotations

from pathlib import Path

from slamreplay.bench.incidents import incident
from slamreplay.bench.logs import bundle_of
from slamreplay.bench.schedule import Case
from slamreplay.postmortem import postmortem
from slamreplay.report.writer import write_report


def write_case(case: Case, folder: Path) -> Path:
    """Make a case's log again, which is cheap, and write its report; the page's path.

    Raises:
        OutputError: the folder is somebody else's or cannot be written.
    """
    bundle, _ = bundle_of(incident(case.kind, case.seed, case.conditions))
    return write_report(postmortem(bundle), folder / case.name)
