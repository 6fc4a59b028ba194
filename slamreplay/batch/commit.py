"""What a worker gave back becomes part of the batch's folder: all of it, or nothing that counts."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from slamreplay.batch.task import LogResult
from slamreplay.bundle.atomic import atomic_folder
from slamreplay.fleet.layout import map_folder
from slamreplay.fleet.store import commit, read
from slamreplay.report import REPORT_FILE

if TYPE_CHECKING:
    import pyarrow as pa

_MAP_MARKER = "map.yaml"

Tell = Callable[[str], None]


def silent(_line: str) -> None:
    """Tell nobody."""


@dataclass(frozen=True)
class Fate:
    """What became of a log.

    Attributes:
        state: of its verdict; None of one that failed.
        error: why it failed, in one line; None of one that did not.
        gate: passed, failed or skipped; None without a gate.
    """

    state: str | None
    error: str | None
    gate: str | None


def commit_result(target: Path, result: LogResult, tell: Tell = silent) -> None:
    """Keep a result. Its rows come last: a log without them is done again, one with them is whole.

    Args:
        target: folder of the batch.
        result: of a log, failed ones included.
        tell: told in a line what of the tables turns out to be damaged.

    Raises:
        OutputError: the place cannot be written.
    """
    (row,) = result.tables["logs"].to_pylist()
    if result.files:
        _write(target / row["report"], result.files, REPORT_FILE)
    if result.map_files:
        place = target / map_folder(row["map_version"])
        if not (place / _MAP_MARKER).exists():
            _write(place, result.map_files, _MAP_MARKER)
    commit(target, result.tables, tell)


def fates(target: Path, tell: Tell = silent) -> dict[str, Fate]:
    """What became of every log that the folder has, by key; `tell` as of `commit_result`."""
    return _fates(read(target, "logs", tell))


def fate_of(result: LogResult) -> Fate:
    """What became of the log of a result."""
    return _fates(result.tables["logs"])[result.key]


def _fates(logs: pa.Table) -> dict[str, Fate]:
    columns = (logs.column(name).to_pylist() for name in ("key", "state", "error", "gate"))
    return {key: Fate(*told) for key, *told in zip(*columns, strict=True)}


def _write(folder: Path, files: Mapping[str, bytes], marker: str) -> None:
    with atomic_folder(folder, marker=marker) as work:
        for name, content in files.items():
            place = work / name
            place.parent.mkdir(parents=True, exist_ok=True)
            with place.open("wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())  # rows that outlive a power cut must have their report
