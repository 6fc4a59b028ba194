"""The logs of an address: of a file, a folder of a store, an index page, or a pattern of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from urllib.parse import unquote

from slamreplay.batch.addresses import is_web, shown
from slamreplay.batch.grouping import Group, logs_among
from slamreplay.batch.patterns import Pattern, fixed_folder, fixed_text, is_pattern, pattern_of
from slamreplay.batch.remote_files import RemoteFile, remote_below, remote_file, remote_files
from slamreplay.batch.task import LogFile, LogSource
from slamreplay.errors import UsageError


def remote_logs(
    place: str, storage: Mapping[str, object], tell: Callable[[str], None]
) -> list[LogSource]:
    """The logs of an address, in their order.

    Args:
        place: the address; `*`, `?` and `[]` in it make it a pattern, at http no `?`.
        storage: options of fsspec.
        tell: told what was skipped, with a count.

    Raises:
        StoreError: it does not exist, or its store cannot be asked.
        UsageError: a pattern of hosts, or no pattern.
    """
    pattern, prefix, root = None, "", place.rstrip("/") + "/"
    if is_pattern(place):
        root = fixed_folder(place)
        pattern = pattern_of(shown(place)[len(shown(root)) :])
        if root.count("/") < 3:
            raise UsageError("a pattern needs the host or bucket before it", where=shown(place))
        prefix = fixed_text(place)[len(root) :]
    else:
        file = remote_file(place, storage)
        if file is not None:
            path = shown(place)
            return [_source(Group(path, "", (path,)), {path: file})]
    skipped: Counter[str] = Counter()
    files = remote_below(
        root, storage, prefix=prefix,
        reaches=lambda url: pattern is None
        or pattern.reaches(url[len(shown(root)) :].rstrip("/").split("/")),
        skipped=lambda why: skipped.update([why]),
    )  # fmt: skip
    for why, count in sorted(skipped.items()):
        tell(f"{shown(root)}: skipped {count} {why}")
    return _sources(files, pattern, shown(root), storage)


def _sources(
    files: list[RemoteFile], pattern: Pattern | None, root: str, storage: Mapping[str, object]
) -> list[LogSource]:
    by_path = {path: file for file in files if "/." not in (path := shown(file.url))}
    groups = [g for g in logs_among(by_path) if pattern is None or g.fits(pattern, root)]
    wanted = [path for group in groups for path in group.members]
    if any(map(is_web, wanted)):
        asked = remote_files([by_path[path].url for path in wanted], storage)
        by_path |= dict(zip(wanted, asked, strict=True))
    return [_source(group, by_path) for group in groups]


def _source(group: Group, by_path: Mapping[str, RemoteFile]) -> LogSource:
    def plain(name: str) -> str:
        return unquote(name) if is_web(group.path) else name

    files = tuple(
        LogFile(found.url, plain(group.name_of(path)), found.size, found.version)
        for path in group.members
        for found in (by_path[path],)
    )
    return LogSource(log=group.path, files=files, folder=plain(group.folder))
