"""What a log is known by in a folder of results, so that nothing is done twice."""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Callable, Mapping
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
    """The task of looking back on one log; arguments and errors as of `task_maker`."""
    return task_maker(cause=cause, demands=demands, storage=storage)(source)


def task_maker(
    *,
    cause: bool = True,
    demands: Demands | None = None,
    storage: Mapping[str, object] | None = None,
    keep_s: float = math.inf,
    now_s: Callable[[], float] = time.monotonic,
) -> Callable[[LogSource], LogTask]:
    """Gives the task of looking back on a log, with the small files it needs.

    Logs of one map share one copy of it. What is given raises `MapError` where the map that the
    table names cannot be read, `UsageError` where the topics file cannot, or they are too large.

    Args:
        cause: replay what went wrong.
        demands: of a gate.
        storage: options of fsspec.
        keep_s: so long a map or topics file is taken to be what it was, s.
        now_s: a clock that never goes back, s.
    """
    storage = dict(storage or {})
    read: dict[tuple[str | None, str | None], tuple[float, Mapping[str, bytes]]] = {}

    def make(source: LogSource) -> LogTask:
        place, now = (source.map, source.topics), now_s()
        since_s, named = read.get(place, (-math.inf, {}))
        if now - since_s >= keep_s or place not in read:
            found = named_files(source, storage)
            named = named if found == named else found  # one copy, as long as it is the same
            read[place] = now, named
        key = key_of(source, cause=cause, demands=demands, named=named)
        return LogTask(key, source, cause, demands, storage, named)

    return make


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
