"""Which logs a batch looks at: folders, files, patterns, manifests and addresses, as one list."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from slamreplay.batch.addresses import absolute, local_path, printable, scheme_of, shown
from slamreplay.batch.grouping import Group, logs_among
from slamreplay.batch.local_files import cannot_read, files_below, fingerprint
from slamreplay.batch.patterns import Pattern, fixed_folder, is_pattern, pattern_of
from slamreplay.batch.task import LogFile, LogSource
from slamreplay.errors import LogError, SlamreplayError, UsageError

Tell = Callable[[str], None]


class NoLogError(LogError):
    """There is no log at all, or none yet."""


def _silent(_remark: str) -> None:
    pass


def sources_of(
    places: Sequence[str],
    maps: None = None,
    storage: Mapping[str, object] | None = None,
    *,
    tell: Tell = _silent,
) -> list[LogSource]:
    """The logs behind what a command line names, each once, sorted by address.

    Args:
        places: files, folders, patterns.
        maps: a table that gives logs their map, topics, robot and labels.
        storage: options of fsspec for addresses.
        tell: told in a sentence what was skipped, with a count.

    Raises:
        LogError: a place cannot be read; `NoLogError` where there is no log at all.
        UsageError: a place that makes no sense.
    """
    found: dict[str, LogSource] = {}
    for place in places:
        for source in _of_place(place, tell):
            found.setdefault(_identity(source), source)
    if not found:
        raise NoLogError(
            "no log there", where=", ".join(shown(p) for p in places[:3]) or None,
            hint="a .bag, .mcap, .db3 or .clf, a folder of rosbag2 or MRCLAM, or a bundle",
        )  # fmt: skip
    return sorted(found.values(), key=lambda source: (source.log, source.files[0].url))


def _identity(source: LogSource) -> str:
    """One log under two names, by a link or by two places that hold it, has one."""
    url = source.files[0].url
    return url if scheme_of(url) else os.path.realpath(url)


def _of_place(place: str, tell: Tell) -> list[LogSource]:
    if scheme_of(place) not in ("", "file"):
        raise UsageError("addresses are not read yet", where=shown(place))
    return _local(local_path(place), tell)


def _local(place: str, tell: Tell) -> list[LogSource]:
    if not place or "\0" in place:
        raise UsageError("a place without a name" if not place else "a name with a zero byte")
    where = absolute(place)
    if not os.path.lexists(where) and is_pattern(place):
        return _below(*_root(place), pattern_of(where), tell)
    if os.path.isdir(where):  # noqa: PTH112 - texts
        return _below(where, os.path.normpath(place), None, tell)
    try:
        Path(where).stat()
    except OSError as error:
        raise cannot_read(place, error) from error
    members = [where] + ([f"{where}-wal"] if Path(f"{where}-wal").is_file() else [])
    return [_source(Group(where, "", tuple(members)), os.path.normpath(place))]


def _root(pattern: str) -> tuple[str, str]:
    """The folder before the first wildcard: absolute, and as it is shown."""
    folder = fixed_folder(pattern) or "."
    return absolute(folder), os.path.normpath(folder)


def _below(root: str, name: str, pattern: Pattern | None, tell: Tell) -> list[LogSource]:
    """The logs below a folder, all of them or those that fit."""
    skipped: Counter[str] = Counter()
    parts = () if root == "/" else tuple(root.split("/"))[1:]

    def reaches(folder: tuple[str, ...]) -> bool:
        return pattern is None or pattern.reaches(("", *parts, *folder))

    try:
        paths = list(files_below(root, reaches, lambda why: skipped.update([why])))
    except LogError as error:
        raise LogError(error.what, where=printable(name)) from error
    for why, count in sorted(skipped.items()):
        tell(f"{printable(name)}: {count} {why} skipped")
    sources = []
    for group in logs_among(paths):
        if pattern is not None and not fits(pattern, group):
            continue
        rest = group.path[len(root) :].strip("/")
        try:
            sources.append(_source(group, os.path.normpath(os.path.join(name, rest))))  # noqa: PTH118
        except SlamreplayError as error:
            tell(f"skipped: {error}")
    return sources


def fits(pattern: Pattern, group: Group) -> bool:
    """Whether a pattern names a log: itself, a folder it lies in, or one of its files."""
    parts = group.path.split("/")
    above = ("/".join(parts[:n]) for n in range(1, len(parts) + 1))
    return any(pattern.match(path) is not None for path in (*group.members, *above))


def _source(group: Group, name: str) -> LogSource:
    files = tuple(_file(path, group) for path in group.members)
    return LogSource(log=printable(name), files=files, folder=group.folder)


def _file(path: str, group: Group) -> LogFile:
    name = path[len(group.path) :].strip("/") if group.folder else path.rpartition("/")[2]
    try:
        size = Path(path).stat().st_size
    except OSError as error:
        raise cannot_read(path, error) from error
    return LogFile(url=path, name=name, size=size, version=fingerprint(Path(path)))
