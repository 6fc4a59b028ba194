"""Which logs a batch looks at: folders, files, patterns, manifests and addresses, as one list."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from slamreplay.batch.addresses import is_remote, local_path, scheme_of, shown
from slamreplay.batch.local_logs import local_logs
from slamreplay.batch.manifests import Entry, is_manifest, read_manifest
from slamreplay.batch.maps_table import MapsTable
from slamreplay.batch.remote_logs import remote_logs
from slamreplay.batch.task import LogSource
from slamreplay.errors import LogError, SlamreplayError

_AT_ONCE = 16
_HINT = "a .bag, .mcap, .db3 or .clf, a folder of rosbag2 or MRCLAM, or a bundle"
Tell = Callable[[str], None]


class NoLogError(LogError):
    """There is no log at all, or none yet."""


def sources_of(
    places: Sequence[str],
    maps: MapsTable | None = None,
    storage: Mapping[str, object] | None = None,
    *,
    tell: Tell = lambda _remark: None,
) -> list[LogSource]:
    """The logs behind what a command line names, each once, sorted by address.

    A place is a file; a folder, of which all logs below it are taken; a pattern (`patterns`), which
    names logs, folders they lie in, or files of them; an address of one of these in a store that
    fsspec reaches, or of an index page; or a manifest of such places (`manifests`). In folders and
    stores logs are known by their names (`grouping`); a file that is named itself is always taken.
    Names that begin with a dot are left out.

    Args:
        places: as above.
        maps: what is known of the logs beside.
        storage: options of fsspec, as of `stores.storage_options`.
        tell: told in one sentence each what was skipped or of no use, with a count.

    Raises:
        LogError: a place does not exist or cannot be read; `NoLogError` where there is no log.
        UsageError: a place or a manifest that makes no sense.
    """
    found: dict[str, LogSource] = {}
    for place in places:
        logs = _of_place(place, storage or {}, tell)
        if not logs and len(places) > 1:
            tell(f"{shown(place)}: no log there")
        for source in logs:
            found.setdefault(_identity(source), source)
    if not found:
        raise NoLogError("no log there", where=", ".join(shown(p) for p in places[:3]) or None,
                       hint=_HINT)  # fmt: skip
    sources = sorted(found.values(), key=lambda source: (source.log, source.files[0].url))
    if maps is not None:
        sources, remarks = maps.applied(sources)
        for remark in remarks:
            tell(remark)
    return sources


def _identity(source: LogSource) -> str:
    """One log under two names, by a link or by two places that hold it, has one."""
    url = source.files[0].url
    return url if scheme_of(url) else os.path.realpath(url)


def _of_place(place: str, storage: Mapping[str, object], tell: Tell) -> list[LogSource]:
    if is_manifest(place) and (is_remote(place) or not Path(local_path(place)).is_dir()):
        return _of_manifest(place, storage, tell)
    return _of_log(place, storage, tell)


def _of_log(place: str, storage: Mapping[str, object], tell: Tell) -> list[LogSource]:
    if is_remote(place):
        return remote_logs(place, storage, tell)
    return local_logs(local_path(place), tell)


def _of_manifest(place: str, storage: Mapping[str, object], tell: Tell) -> list[LogSource]:
    """The logs of all lines; lines that name none are counted."""

    def one(entry: Entry) -> tuple[list[LogSource], list[str], SlamreplayError | None]:
        remarks: list[str] = []
        try:
            return _of_log(entry.place, storage, remarks.append), remarks, None
        except SlamreplayError as error:
            return [], remarks, error

    entries = read_manifest(place, storage)
    with ThreadPoolExecutor(_AT_ONCE) as pool:  # a store answers many questions at once
        answers = list(pool.map(one, entries))
    found: list[LogSource] = []
    empty = []
    for entry, (sources, remarks, error) in zip(entries, answers, strict=True):
        for remark in remarks:
            tell(remark)
        if not sources:
            empty.append((entry, error))
        found += [
            replace(s, labels=entry.labels, map=entry.map, topics=entry.topics, robot=entry.robot)
            for s in sources
        ]
    if empty:
        entry, error = empty[0]
        why = error or f"{shown(entry.place)}: no log there"
        remark = f"{shown(place)}: {len(empty)} of {len(entries)} lines name no log: row "
        remark += f"{entry.line}: {why}" + (" (and others)" if len(empty) > 1 else "")
        if not found:
            raise LogError(remark.partition(": ")[2], where=shown(place))
        tell(remark)
    return found
