"""Manifests: files that list logs, one a line, with what is known of each.

A place that ends with `.txt`, `.csv` or `.jsonl` is one. `.txt`: a place a line, empty lines and
those with # left out. `.csv`: a header with `log` and, if wanted, `map`, `topics`, `robot_ns`;
every other column is a label. `.jsonl`: an object a line with the same keys. Places, maps and
topics files are relative to the manifest; a place may be a folder or a pattern, too.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass

from slamreplay.batch.addresses import beside, name_of, printable, shown
from slamreplay.batch.delimited import MAX_VALUE, NAME, Row, read_rows
from slamreplay.batch.small_files import read_small
from slamreplay.errors import UsageError

COLUMNS = ("log", "map", "topics", "robot_ns")
_SUFFIXES = (".txt", ".csv", ".jsonl")
_MOST = 50_000_000


@dataclass(frozen=True)
class Entry:
    """A line of a manifest.

    Attributes:
        line: its number.
        place: file, folder, pattern or address.
        map: of its map's yaml.
        topics: of its topics file.
        robot: namespace.
        labels: the rest.
    """

    line: int
    place: str
    map: str | None
    topics: str | None
    robot: str | None
    labels: Mapping[str, str]


def is_manifest(place: str) -> bool:
    """Whether a place names a manifest."""
    return name_of(place).lower().endswith(_SUFFIXES)


def read_manifest(place: str, storage: Mapping[str, object]) -> list[Entry]:
    """The lines of a manifest.

    Raises:
        LogError: it cannot be read.
        UsageError: a line that makes no sense, with its number.
    """
    where = shown(place)
    content = read_small(place, storage, most=_MOST)
    if name_of(place).lower().endswith(".csv"):
        rows = read_rows(content, where, required="log", known=COLUMNS)
    else:
        rows = _lines(content, where, is_json=name_of(place).lower().endswith(".jsonl"))
    if not rows:
        raise UsageError("a manifest without a log", where=where, hint="one log a line")
    return [_entry(row, place, where) for row in rows]


def _entry(row: Row, place: str, where: str) -> Entry:
    cells = dict(row.cells)
    log = beside(place, cells.pop("log"))
    assert log is not None
    if is_manifest(log):
        raise UsageError(f"row {row.number}: a manifest in a manifest", where=where,
                         hint="name both on the command line")  # fmt: skip
    known = [beside(place, cells.pop(name, None)) for name in ("map", "topics")]
    return Entry(row.number, log, known[0], known[1], cells.pop("robot_ns", None), cells)


def _lines(content: bytes, where: str, *, is_json: bool) -> list[Row]:
    try:
        lines = content.decode("utf-8-sig").split("\n")
    except UnicodeDecodeError as error:
        raise UsageError("not a text in UTF-8", where=where) from error
    found = []
    for number, text in enumerate(lines, 1):
        line = text.strip()
        if not line or (line.startswith("#") and not is_json):
            continue
        cells = _cells(line, f"row {number}", where) if is_json else {"log": line}
        if "\0" in cells["log"] or len(line) > 100 * MAX_VALUE:
            raise UsageError(f"row {number}: no name of a log", where=where)
        found.append(Row(number, cells))
    return found


def _cells(line: str, row: str, where: str) -> dict[str, str]:
    try:
        given = json.loads(line)
    except (ValueError, RecursionError) as error:
        hint = 'a line is as {"log": "a.mcap", "site": "north"}'
        raise UsageError(f"{row}: not JSON", where=where, hint=hint) from error
    if not isinstance(given, dict) or not isinstance(given.get("log"), str) or not given["log"]:
        raise UsageError(f"{row}: it has no 'log'", where=where)
    cells = {}
    for name, value in given.items():
        if value is None:
            continue
        text = value if isinstance(value, str) else json.dumps(value)
        if not NAME.fullmatch(name) or isinstance(value, list | dict):
            raise UsageError(f"{row}: '{printable(name)[:40]}' is no label", where=where,
                             hint="a name of small letters, digits and _, and a text")  # fmt: skip
        if len(text) > MAX_VALUE or not (text.isprintable() or name == "log"):
            raise UsageError(f"{row}: the value of '{name}' is no text of one line", where=where)
        cells[name] = text
    return cells
