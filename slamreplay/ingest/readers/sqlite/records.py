"""Rows of the small tables of an SQLite file, one by one: its schema, topics, definitions."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from slamreplay.ingest.readers.sqlite.btree import INTERIOR, LEAF, Cells
from slamreplay.ingest.readers.sqlite.numbers import (
    Bytes,
    Ints,
    signed,
    type_bytes,
    unsigned,
    varints,
)
from slamreplay.ingest.readers.sqlite.pages import Pages

Value = int | str | bytes | None
_CONSTRAINTS = {"PRIMARY", "UNIQUE", "CHECK", "FOREIGN", "CONSTRAINT"}


def rows(pages: Pages, numbers: Ints) -> Iterator[tuple[int, list[Value]]]:
    """Row id and values of the rows on leaf pages; None also for a value that is not all there."""
    block = pages.read(numbers)
    cells = block.cells()
    for at in np.flatnonzero(cells.sound & (block.kinds == LEAF)[cells.row]):
        yield int(cells.rowid[at]), _values(_payload(pages, cells, int(at)))


def tables(pages: Pages) -> list[tuple[str, int, list[str]]]:
    """Name, root page and columns of the tables in the schema, as far as it can be read."""
    found = []
    level, seen = np.array([1]), {0}
    while len(level):
        seen.update(level.tolist())
        for _, values in rows(pages, level):
            match values:
                case ["table", str(name), str(), int(root), str(statement)]:
                    found.append((name, root, column_names(statement)))
        block = pages.read(level[pages.read(level).kinds == INTERIOR])
        children = np.unique(block.edges().child)
        level = np.array([c for c in children.tolist() if c <= pages.count and c not in seen])
    return found


def column_names(statement: str) -> list[str]:
    """Columns of a CREATE TABLE statement."""
    inner = statement[statement.find("(") + 1 : statement.rfind(")")]
    while "(" in inner:
        inner, before = re.sub(r"\([^()]*\)", "", inner), inner
        if inner == before:
            break
    words = [part.split(maxsplit=1)[0] for part in inner.split(",") if part.strip()]
    return [word.strip("\"'`[]") for word in words if word.upper() not in _CONSTRAINTS]


def _payload(pages: Pages, cells: Cells, at: int) -> bytes:
    """A cell's payload, or its beginning where an overflow page is missing."""
    body, local = int(cells.body[at]), int(cells.local[at])
    parts = [cells.block.flat[body : body + local]]
    left, page, seen = int(cells.payload[at]) - local, int(cells.overflow[at]), {0}
    while left > 0 and page not in seen and page <= pages.count:
        block = pages.read(np.array([page]))
        if not block.whole.all():
            break
        parts.append(block.flat[4 : min(4 + left, pages.usable)])
        seen.add(page)
        left -= pages.usable - 4
        page = int(unsigned(block.flat, np.array([0]), 4)[0])
    return np.concatenate(parts).tobytes()


def _values(payload: bytes) -> list[Value]:
    flat = np.frombuffer(payload + bytes(64), dtype=np.uint8)
    header, at = _varint(flat, 0)
    header = min(header, len(payload))
    start, values = header, []
    while at < header:
        kind, at = _varint(flat, at)
        end = start + int(type_bytes(np.array([kind]))[0])
        values.append(
            _value(flat, payload[start:end], start, kind) if end <= len(payload) else None
        )
        start = end
    return values


def _value(flat: Bytes, content: bytes, start: int, kind: int) -> Value:
    if kind >= 12:
        return content.decode("utf-8", "replace") if kind % 2 else content
    if kind in {0, 7}:  # null; rosbag2 has no reals
        return None
    return int(signed(flat, np.array([start]), np.array([kind]))[0])


def _varint(flat: Bytes, at: int) -> tuple[int, int]:
    value, width = varints(flat, np.array([at]))
    return int(value[0]), at + int(width[0])
