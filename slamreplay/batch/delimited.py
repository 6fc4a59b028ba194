"""Tables that people write by hand or export from a spreadsheet: CSV, read strictly."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches

from slamreplay.errors import UsageError

#: A label's name; a value longer than this, or more columns, is no label but another file.
NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")
MAX_VALUE, MAX_COLUMNS = 500, 40


@dataclass(frozen=True)
class Row:
    """A row.

    Attributes:
        number: as an editor counts lines, the header being the first.
        cells: text by column, empty ones left out.
    """

    number: int
    cells: dict[str, str]


def read_rows(content: bytes, where: str, *, required: str, known: Sequence[str]) -> list[Row]:
    """The rows of a table with a header; all columns that are not `known` ones are labels.

    Args:
        content: of the file.
        where: its name, for errors.
        required: the column that every row must fill.
        known: columns with a meaning of their own.

    Raises:
        UsageError: one line with the file, the row, the column and a hint.
    """
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UsageError("not a text in UTF-8", where=where) from error
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    header: list[str] | None = None
    rows = []
    try:
        for cells in reader:
            cells = [cell.strip() for cell in cells]
            if not any(cells) or (cells[0].startswith("#") and header is None):
                continue
            if header is None:
                header = _header(cells, where, required, known)
                continue
            rows.append(_row(cells, reader.line_num, header, where, required))
    except csv.Error as error:
        raise UsageError(
            f"row {reader.line_num + 1}: {error}", where=where,
            hint="a cell with a comma or a quote stands in double quotes",
        ) from error  # fmt: skip
    if header is None:
        raise UsageError("an empty table", where=where, hint=f"its first row names {required}")
    return rows


def _header(cells: list[str], where: str, required: str, known: Sequence[str]) -> list[str]:
    names = [cell.lower() for cell in cells]
    while names and not names[-1]:  # a spreadsheet's empty columns
        names.pop()
    if required not in names:
        semicolons = len(names) == 1 and re.search("[;\t]", names[0])
        near = get_close_matches(required, names, n=1)
        raise UsageError(
            f"row 1: there is no column '{required}'", where=where,
            hint="separate columns by commas" if semicolons
            else f"did you mean '{required}' by '{near[0]}'?" if near
            else f"known columns are {', '.join(known)}; all others are labels",
        )  # fmt: skip
    if len(names) > MAX_COLUMNS:
        raise UsageError(f"row 1: more than {MAX_COLUMNS} columns", where=where)
    for name in names:
        if not NAME.fullmatch(name):
            raise UsageError(
                f"row 1: a column cannot be called '{_short(name)}'", where=where,
                hint="small letters, digits and _, as in site",
            )  # fmt: skip
        if names.count(name) > 1:
            raise UsageError(f"row 1: two columns are called '{name}'", where=where)
        near = get_close_matches(name, known, n=1, cutoff=0.8)
        if name not in known and near:
            raise UsageError(f"row 1: there is no column '{name}'", where=where,
                             hint=f"did you mean '{near[0]}'?")  # fmt: skip
    return names


def _row(cells: list[str], number: int, header: list[str], where: str, required: str) -> Row:
    if any(cells[len(header) :]):
        raise UsageError(
            f"row {number}: more cells than the header has columns ({len(header)})", where=where,
            hint="a cell with a comma stands in double quotes",
        )  # fmt: skip
    found = {n: c for n, c in zip(header, cells, strict=False) if c}
    for name, cell in found.items():
        if len(cell) > MAX_VALUE or not cell.isprintable():
            what = "is too long" if len(cell) > MAX_VALUE else "cannot be printed"
            raise UsageError(f"row {number}, column {name}: '{_short(cell)}' {what}", where=where)
    if required not in found:
        raise UsageError(f"row {number}, column {required}: it is empty", where=where)
    return Row(number, found)


def _short(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text[:40])
