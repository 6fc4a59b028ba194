"""What one worker is given, and what it gives back: no folder is shared between machines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pyarrow as pa

    from slamreplay.gate.rules import Demands


@dataclass(frozen=True)
class LogFile:
    """One file of a log.

    Attributes:
        url: as fsspec takes it; a local one is an absolute path. It may hold a password or a
            signature: what people see is `LogSource.log`.
        name: from the log's own place: of a folder of rosbag2 the path within it.
        size: in bytes, None where the store does not tell.
        version: what changes with the content: of a local file `local_files.fingerprint`, of
            another the ETag or the time of its last change, empty where the store tells neither.
    """

    url: str
    name: str
    size: int | None
    version: str


@dataclass(frozen=True)
class LogSource:
    """One log of a batch.

    Attributes:
        log: its path or address as shown to people.
        files: one for a container (a database's write-ahead log comes after it), several for a
            folder of rosbag2 or MRCLAM or a bundle.
        labels: site, robot, software and the like, by name.
        map: address of its map's yaml, None where it has its own or none.
        topics: address of its topics file, None for a choice by looks.
        robot: namespace of the robot to look at.
        folder: its name where the log is a folder, else empty.
    """

    log: str
    files: tuple[LogFile, ...]
    labels: Mapping[str, str] = field(default_factory=dict)
    map: str | None = None
    topics: str | None = None
    robot: str | None = None
    folder: str = ""


@dataclass(frozen=True)
class LogTask:
    """A log to be looked back on.

    Attributes:
        key: 32 hex digits: the log and how it is read, as of `keys.key_of`. What has this key
            already is not done again.
        source: the log.
        cause: replay what went wrong, as of `postmortem`.
        demands: of a gate, None without one.
        storage: options of fsspec for the source's addresses.
        named: content by path of the small files the task needs beside the log, read by the client,
            so that workers need not reach them: `map/NAME.yaml` and its image, `topics/NAME.yaml`.
            `named.placed` puts them into a folder.
    """

    key: str
    source: LogSource
    cause: bool = True
    demands: Demands | None = None
    storage: Mapping[str, object] = field(default_factory=dict)
    named: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class LogResult:
    """What became of it. A failed one has a line and nothing else.

    Attributes:
        key: of the task.
        error: one line of what, where and a hint; None if it went well.
        files: of its report, by path within its folder.
        map_files: of the map it was judged against (`map.yaml`, `map.pgm`), empty without one.
        tables: rows by table of `fleet.schema`; of a failed one `logs` and `costs`.
    """

    key: str
    error: str | None
    files: Mapping[str, bytes]
    map_files: Mapping[str, bytes]
    tables: Mapping[str, pa.Table]
