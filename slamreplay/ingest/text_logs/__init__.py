"""Logs as lines of text: CARMEN files and MRCLAM folders, told by their content.

They hold no messages that a decoder could be given, so each format is read whole, straight into
rows of the bundle's tables.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from slamreplay.errors import LogError, UsageError

if TYPE_CHECKING:
    from slamreplay.ingest.text_logs.log import TextLog

__all__ = ["read_text_log", "text_log"]


def text_log(path: Path) -> Callable[[Path, str | None], TextLog] | None:
    """What reads a path (given the robot's name), or None where it is no text log.

    Raises:
        LogError: one file of an MRCLAM folder, or a name that no file can have.
    """
    from slamreplay.ingest.text_logs.carmen import read_carmen
    from slamreplay.ingest.text_logs.carmen_lines import is_carmen
    from slamreplay.ingest.text_logs.lines import head_of
    from slamreplay.ingest.text_logs.mrclam import read_mrclam, robots_of

    try:
        is_folder = path.is_dir()
    except OSError as error:
        raise LogError(f"cannot read it: {error.strerror}", where=path) from error
    if is_folder:
        return read_mrclam if robots_of(path) else None
    head = head_of(path)
    if head.startswith(b"# UTIAS Multi-Robot"):
        hint = "give the folder it lies in, and --robot"
        raise LogError("one file of an MRCLAM folder is no log", where=path, hint=hint)
    return read_carmen if is_carmen(head) else None


def read_text_log(paths: Sequence[Path], robot: str | None) -> TextLog | None:
    """The text log behind the paths, or None where they are none.

    Raises:
        LogError: the log cannot be read.
        UsageError: more paths than one, or a robot that is not in it.
    """
    found = [(path, read) for path in paths if (read := text_log(path)) is not None]
    if not found:
        return None
    if len(paths) > 1:  # each counts its log times from 0
        raise UsageError("a text log is read alone", where=found[0][0], hint="give one at a time")
    path, read = found[0]
    return read(path, robot)
