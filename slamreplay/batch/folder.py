"""The folder of a batch: what lies where in it, and who may write to it."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from slamreplay.batch.lock import held_lock
from slamreplay.batch.task import LogTask
from slamreplay.bundle.atomic import check_target, write_file
from slamreplay.errors import OutputError
from slamreplay.fleet.layout import MAPS, PAGE_FILE, QUERIES_FILE

#: Marks a folder as ours.
MARKER = "batch.json"
REPORTS, SCRATCH, LOCK = "logs", ".scratch", ".lock"
VERSION = 1

_NAME_LENGTH = 60


@contextmanager
def batch_folder(target: Path) -> Iterator[Path]:
    """A batch's folder for the time of one run, locked against others; gives its scratch folder.

    Raises:
        OutputError: it is somebody else's, of another version, cannot be written, or another
            program is at work in it.
    """
    check_target(target, MARKER)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write: {error.strerror or error}", where=target) from error
    _settle_marker(target / MARKER)
    with held_lock(target / LOCK):
        scratch = target / SCRATCH
        try:
            _clear(target)
            scratch.mkdir()
        except OSError as error:
            raise OutputError(f"cannot write: {error.strerror or error}", where=target) from error
        try:
            yield scratch
        finally:
            shutil.rmtree(scratch, ignore_errors=True)


def _clear(target: Path) -> None:
    """Remove what one that was killed had not finished."""
    shutil.rmtree(target / SCRATCH, ignore_errors=True)
    for folder in (target / REPORTS, target / MAPS):
        for left in folder.glob(".*"):  # as of `atomic_folder`; names of ours begin with no dot
            shutil.rmtree(left, ignore_errors=True)
    for name in (MARKER, PAGE_FILE, QUERIES_FILE):
        for file in target.glob(f".{name}.*"):  # as of `write_file`
            file.unlink(missing_ok=True)


def report_folder(task: LogTask) -> str:
    """Where the report of a log goes, from the batch's folder: readable, and no other log's."""
    name = re.split(r"[/\\]", task.source.log.rstrip("/\\"))[-1]
    plain = re.sub(r"[^A-Za-z0-9._-]+", "_", name).strip("._")[:_NAME_LENGTH] or "log"
    return f"{REPORTS}/{plain}-{task.key[:12]}"


def _settle_marker(marker: Path) -> None:
    if not marker.exists():
        write_file(
            marker, (json.dumps({"slamreplay": "batch", "version": VERSION}) + "\n").encode()
        )
        return
    try:
        found = json.loads(marker.read_text(encoding="utf-8"))
        version = found["version"] if found["slamreplay"] == "batch" else None
    except (OSError, ValueError, KeyError, TypeError):
        version = None
    if version != VERSION:
        said = "is none of a batch" if version is None else f"is of version {version}"
        raise OutputError(said, where=marker, hint="name another output with -o")
