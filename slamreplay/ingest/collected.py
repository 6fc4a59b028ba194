"""Rows of all topics while a log is read: part by part, in memory or on disk, joined at the end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from slamreplay.bundle.tables import concatenated
from slamreplay.ingest.rows import TopicRows
from slamreplay.ingest.spill import MEMORY_BYTES, SpilledColumns


class Collected:
    """Rows of all topics while a log is read, in memory or, past `MEMORY_BYTES`, on disk.

    Args:
        folder: for the columns on disk; None to keep everything in memory.
    """

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._held = 0
        self._parts: dict[tuple[str, str, str], list[TopicRows]] = {}
        self._columns: dict[tuple[str, str, str], SpilledColumns] = {}

    def add(self, parts: Sequence[TopicRows]) -> None:
        """Rows of one topic, after those that are there."""
        for part in parts:
            key = (part.topic, part.type, part.table)
            self._parts.setdefault(key, []).append(part)
            self._held += part.nbytes
            if key in self._columns:
                self._spill(key)
        if self._folder is not None and self._held > MEMORY_BYTES:
            for key in self._parts:
                self._spill(key)
            self._held = 0

    def finish(self) -> list[TopicRows]:
        """One set of rows for each topic and type, sorted by these."""
        return [_joined(self._parts.pop(key)) for key in sorted(self._parts)]

    def _spill(self, key: tuple[str, str, str]) -> None:
        """Put a topic's columns on disk; they stand for all its parts from then on."""
        parts = self._parts[key]
        if key not in self._columns and self._folder is not None:
            self._columns[key] = SpilledColumns(self._folder / str(len(self._columns)))
        columns = self._columns[key]
        for part in parts:
            if part.columns is not columns:
                columns.append(part.columns, len(part))
        self._parts[key] = [_times_joined(parts, columns)]


def _joined(parts: list[TopicRows]) -> TopicRows:
    """One set of rows, ordered by log time (files of one log may come in any order)."""
    columns = parts[0].columns
    if len(parts) > 1:  # a column at a time, so that no more than one of them is there twice
        own = [dict(p.columns) for p in parts]
        names = list(columns)
        parts[:] = [replace(p, columns={}) for p in parts]
        columns = {name: concatenated([c.pop(name) for c in own]) for name in names}
    whole = _times_joined(parts, columns)
    if (whole.t_log_ns[1:] >= whole.t_log_ns[:-1]).all():
        return whole
    return whole.take(np.argsort(whole.t_log_ns, kind="stable"))


def _times_joined(parts: Sequence[TopicRows], columns: Mapping[str, Any]) -> TopicRows:
    return replace(
        parts[0],
        messages=sum(p.messages for p in parts),
        columns=columns,
        t_sensor_ns=np.concatenate([p.t_sensor_ns for p in parts]),
        t_log_ns=np.concatenate([p.t_log_ns for p in parts]),
    )
