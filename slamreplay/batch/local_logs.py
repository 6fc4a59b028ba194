"""The logs of a place on this machine."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from slamreplay.batch.addresses import absolute, printable
from slamreplay.batch.grouping import WAL, Group, logs_among
from slamreplay.batch.local_files import cannot_read, files_below, fingerprint
from slamreplay.batch.patterns import Pattern, fixed_folder, is_pattern, pattern_of
from slamreplay.batch.task import LogFile, LogSource
from slamreplay.errors import LogError, SlamreplayError, UsageError


def local_logs(place: str, tell: Callable[[str], None]) -> list[LogSource]:
    """The logs of a file, a folder or a pattern, in the order of their paths.

    Args:
        place: a path; a name with `*` in it that there is, is no pattern.
        tell: told what was skipped, with a count.

    Raises:
        LogError: it does not exist or cannot be read.
        UsageError: no name, or no pattern.
    """
    if not place or "\0" in place:
        raise UsageError("a place without a name" if not place else "a name with a zero byte")
    place = place.replace(os.sep, "/")
    where = absolute(place)
    if not os.path.lexists(where) and is_pattern(place):
        folder = fixed_folder(place)
        pattern = pattern_of(place[len(folder) :])
        return _below(absolute(folder or "."), os.path.normpath(folder or "."), pattern, tell)
    if Path(where).is_dir():
        return _below(where, os.path.normpath(place), None, tell)
    try:
        Path(where).stat()
        members = [where] + ([where + WAL] if Path(where + WAL).is_file() else [])
    except OSError as error:
        raise cannot_read(place, error) from error
    return [_source(Group(where, "", tuple(members)), os.path.normpath(place))]


def _below(
    root: str, name: str, pattern: Pattern | None, tell: Callable[[str], None]
) -> list[LogSource]:
    """The logs below a folder, all of them or those that fit."""
    skipped: Counter[str] = Counter()
    reaches = (lambda _folder: True) if pattern is None else pattern.reaches
    try:
        paths = list(files_below(root, reaches, lambda why: skipped.update([why])))
    except LogError as error:
        raise LogError(error.what, where=printable(name)) from error
    sources = []
    for group in logs_among(paths):
        if pattern is not None and not group.fits(pattern, root.rstrip("/") + "/"):
            continue
        rest = group.path[len(root) :].strip("/")
        try:
            sources.append(_source(group, os.path.normpath(os.path.join(name, rest))))  # noqa: PTH118
        except SlamreplayError as error:
            skipped[f"logs ({error})"] += 1
    for why, count in sorted(skipped.items()):
        tell(f"{printable(name)}: skipped {count} {why}")
    return sources


def _source(group: Group, name: str) -> LogSource:
    files = tuple(_file(path, group) for path in group.members)
    return LogSource(log=printable(name), files=files, folder=group.folder)


def _file(path: str, group: Group) -> LogFile:
    try:
        size = Path(path).stat().st_size
    except OSError as error:
        raise cannot_read(path, error) from error
    return LogFile(path, group.name_of(path), size, fingerprint(Path(path)))
