"""What a log is known by in a folder of results, so that nothing is done twice."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import lru_cache
from typing import TYPE_CHECKING

from slamreplay.batch.addresses import shown
from slamreplay.batch.named import named_files
from slamreplay.batch.task import LogSource, LogTask

if TYPE_CHECKING:
    from slamreplay.gate.rules import Demands


def task_of(
    source: LogSource,
    *,
    cause: bool = True,
    demands: Demands | None = None,
    storage: Mapping[str, object] | None = None,
) -> LogTask:
    """The task of looking back on a log, with the small files it needs.

    Args:
        source: the log.
        cause: replay what went wrong.
        demands: of a gate.
        storage: options of fsspec.

    Raises:
        MapError: the map that the table names cannot be read.
        UsageError: the topics file cannot, or they are too large.
    """
    named = named_files(source, storage or {})
    key = key_of(source, cause=cause, demands=demands, named=named)
    return LogTask(key, source, cause, demands, dict(storage or {}), named)


def tasks_of(
    sources: Sequence[LogSource],
    *,
    cause: bool = True,
    demands: Demands | None = None,
    storage: Mapping[str, object] | None = None,
) -> list[LogTask]:
    """The tasks of many logs, as of `task_of`; those of one map share one copy of it."""
    storage = dict(storage or {})
    read: dict[tuple[str | None, str | None], Mapping[str, bytes]] = {}
    tasks = []
    for source in sources:
        place = source.map, source.topics
        if place not in read:
            read[place] = named_files(source, storage)
        key = key_of(source, cause=cause, demands=demands, named=read[place])
        tasks.append(LogTask(key, source, cause, demands, storage, read[place]))
    return tasks


def key_of(
    source: LogSource,
    *,
    cause: bool = True,
    demands: Demands | None = None,
    named: Mapping[str, bytes] | None = None,
) -> str:
    """32 hex digits over all that the answer depends on but the program itself.

    That is: address (without passwords and signatures), name, size and version of each file; the
    robot; the content, not the place, of the map and the topics file; `cause`; the demands. Two
    batches of months apart go on where one ended though the program is newer: which version judged
    a log stands in its row. Options of the store are left out: they say how to get in, not what is
    there. So are labels, on which no verdict depends: see `relabel`.
    """
    told = {
        "files": [[shown(f.url), f.name, f.size, f.version] for f in source.files],
        "folder": source.folder,
        "robot": source.robot,
        "cause": cause,
        "demands": None if demands is None else _in_order(asdict(demands)),
        "named": sorted((n, _digest(c)) for n, c in (named or {}).items()),
    }
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()[:32]


@lru_cache(maxsize=8)
def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _in_order(demands: dict[str, object]) -> dict[str, object]:
    """As JSON, which sorts keys, may have it: of patterns the first that fits counts."""
    of_logs = demands["of_logs"]
    assert isinstance(of_logs, Mapping)
    return {**demands, "of_logs": list(of_logs.items())}
