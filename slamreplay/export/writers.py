"""Each format's writer: a request in, files in a folder out, which is whole or absent."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from slamreplay.bundle.atomic import atomic_folder
from slamreplay.bundle.run import Run
from slamreplay.bundle.view import Bundle
from slamreplay.export.formats import MARKER, Format, NotAsRecorded, Written
from slamreplay.export.request import Request, window_of

__all__ = ["Request", "redacted", "window_of", "write_export"]

Writer = Callable[[Request, Path], Sequence[NotAsRecorded]]


def redacted(bundle: Bundle, runs: Sequence[Run]) -> tuple[Bundle, list[Run]]:
    """A log and runs on it with names that identify nobody."""
    from slamreplay.export.redaction import Redactor

    redactor = Redactor(bundle)
    return redactor.bundle(), [redactor.run(run) for run in runs]


def write_export(request: Request, to: Format, target: Path) -> Written:
    """Write a format's files and export.json into the folder `target`.

    Raises:
        UsageError: there is nothing to write.
        OutputError: the folder is somebody else's, or cannot be written.
    """
    with atomic_folder(target, marker=MARKER) as work:
        missed = tuple(_WRITERS[to](request, work))
        files = sorted(p.relative_to(work).as_posix() for p in work.rglob("*") if p.is_file())
        head = _head(request, to, files, missed)
        text = json.dumps(head, indent=1, allow_nan=False)
        (work / MARKER).write_text(text + "\n", encoding="utf-8")
    return Written(head, missed)


def _head(
    request: Request, to: Format, files: list[str], missed: Sequence[NotAsRecorded]
) -> dict[str, Any]:
    """export.json: only what is out of the usual has a key of its own."""
    head: dict[str, Any] = {"format": to.value, "files": files}
    if request.window is not None:
        head["window_ns"] = [request.window.start_ns, request.window.end_ns]
    if request.redacted:
        head["redacted"] = True
    if missed:
        head["not_as_recorded"] = [vars(one) for one in missed]
    return head


def _tum(request: Request, folder: Path) -> Sequence[NotAsRecorded]:
    from slamreplay.export.tum import write_tum

    return write_tum(request, folder)


def _csv(request: Request, folder: Path) -> Sequence[NotAsRecorded]:
    from slamreplay.export.spreadsheets.writer import write_csv

    write_csv(request, folder)
    return ()


def _mcap(request: Request, folder: Path) -> Sequence[NotAsRecorded]:
    missed: Sequence[NotAsRecorded] = ()
    if request.recorded:
        from slamreplay.export.recorded.writer import write_recorded

        missed = write_recorded(request, folder)
    if request.post is not None:
        from slamreplay.export.foxglove import write_foxglove

        write_foxglove(
            request.post,
            request.bundle.view(),
            folder,
            report_json=request.report_json,
            **_shared(request),
        )
    return missed


def _rerun(request: Request, folder: Path) -> Sequence[NotAsRecorded]:
    from slamreplay.export.rerun import write_rerun

    assert request.post is not None
    write_rerun(request.post, request.bundle.view(), folder, **_shared(request))
    return ()


def _rviz(request: Request, folder: Path) -> Sequence[NotAsRecorded]:
    from slamreplay.export.rviz.writer import write_rviz

    write_rviz(request, folder)
    return ()


_WRITERS: dict[Format, Writer] = {
    Format.TUM: _tum,
    Format.CSV: _csv,
    Format.MCAP: _mcap,
    Format.RERUN: _rerun,
    Format.RVIZ: _rviz,
}


def _shared(request: Request) -> dict[str, Any]:
    """What the writers of an analysis are told alike."""
    window = request.window
    return {
        "runs": request.runs,
        "start_ns": None if window is None else window.start_ns,
        "end_ns": None if window is None else window.end_ns,
    }
