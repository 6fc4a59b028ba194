"""rosbag2's tables in an SQLite file: where they are, and its topics and definitions.

The schema's versions 1 to 4 (rosbag2_storage_sqlite3) differ in tables and columns that are of no
use here: `messages` is (id, topic_id, timestamp, data) in all of them, `topics` begins with (id,
name, type, serialization_format), version 4 has `message_definitions`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from slamreplay.ingest.readers.sqlite.numbers import Mask
from slamreplay.ingest.readers.sqlite.pages import Pages
from slamreplay.ingest.readers.sqlite.records import Value, rows, tables
from slamreplay.ingest.readers.sqlite.scan import MESSAGE_COLUMNS, Scan, scan
from slamreplay.ingest.readers.sqlite.tree import Tree

SMALL_TABLES = ("schema", "metadata", "topics", "message_definitions")
TOPIC_COLUMNS = ("id", "name", "type", "serialization_format")
DEFINITION_COLUMNS = ("id", "topic_type", "encoding", "encoded_message_definition")
_ENCODINGS = {"ros2msg", "ros2idl"}
_TYPE = re.compile(r"[A-Za-z]\w*(/\w+)+")

Topic = tuple[int, str, str, str]


@dataclass(frozen=True)
class Schema:
    """What page 1 says of the tables.

    Attributes:
        roots: root page of each table whose name can be read.
        columns: their columns.
    """

    roots: dict[str, int]
    columns: dict[str, list[str]]

    @classmethod
    def read(cls, pages: Pages) -> Schema:
        """The schema as far as it can be read; a root that two tables share is nobody's."""
        found = tables(pages)
        shared = Counter(root for _, root, _ in found)
        roots = {name: root for name, root, _ in found if shared[root] == 1 and root > 1}
        return cls(roots, {name: columns for name, _, columns in found})

    def scan(self, pages: Pages) -> Scan:
        """Scan for messages, in rosbag2's columns where the schema's make no sense."""
        columns = self.columns.get("messages", [])
        if tuple(columns) != MESSAGE_COLUMNS and set(MESSAGE_COLUMNS[1:]) <= set(columns):
            found = scan(pages, columns)
            if len(found.messages):
                return found
        return scan(pages)

    def root(self, table: str, found: Scan) -> int:
        """Root page of a table; 0 where it is unknown, or some other page's child."""
        root = self.roots.get(table, 0)
        return 0 if (found.structure.child == root).any() else root


def read_topics(pages: Pages, schema: Schema, tree: Tree, strays: Mask) -> list[Topic]:
    """Topics by number; `strays` are pages whose rows are topics if they look like it."""
    topics: dict[int, Topic] = {}
    for number, texts, stray in _texts(pages, schema, "topics", TOPIC_COLUMNS, tree, strays):
        name, kind, encoding = texts
        if name and kind and not (stray and (kind in _ENCODINGS or not _TYPE.fullmatch(kind))):
            topics.setdefault(number, (number, name, kind, encoding or ""))
    return [topics[number] for number in sorted(topics)]


def read_definitions(
    pages: Pages, schema: Schema, tree: Tree, strays: Mask
) -> dict[str, tuple[str, str]]:
    """Encoding and text of each type's definition; `strays` as for topics."""
    found: dict[str, tuple[str, str]] = {}
    table = "message_definitions"
    for _, texts, stray in _texts(pages, schema, table, DEFINITION_COLUMNS, tree, strays):
        kind, encoding, text = texts
        if kind and encoding and text and not (stray and encoding not in _ENCODINGS):
            found.setdefault(kind, (encoding, text))
    return found


def _texts(
    pages: Pages,
    schema: Schema,
    table: str,
    columns: Sequence[str],
    tree: Tree,
    strays: Mask,
) -> Iterator[tuple[int, list[str | None], bool]]:
    """Row id and texts of a table's rows, then of those on stray pages where its tree has holes."""
    names = schema.columns.get(table, [])
    if not set(columns) <= set(names):
        names = list(columns)
    at = [names.index(column) for column in columns[1:]]
    for number, values in rows(pages, tree.leaves):
        yield number, [_text(values, i) for i in at], False
    if len(tree.holes):
        for number, values in rows(pages, np.flatnonzero(strays)):
            yield number, [_text(values, i) for i in range(1, len(columns))], True


def _text(values: Sequence[Value], at: int) -> str | None:
    value = values[at] if at < len(values) else None
    return value if isinstance(value, str) else None
