"""Rows as text in columns, as a terminal shows them."""

from __future__ import annotations

from collections.abc import Sequence


def in_columns(
    rows: Sequence[Sequence[str]], *, words: int | None = None, ends: Sequence[str] = ()
) -> str:
    """One line a row, each column as wide as its widest cell.

    Args:
        rows: cells; a row may have fewer than the first one.
        words: so many columns are flush left, the others, which hold numbers, flush right; None
            takes all for words.
        ends: a text behind each row, which widens no column.
    """
    words = len(rows[0]) if words is None else words
    widths = [max(len(row[k]) for row in rows if k < len(row)) for k in range(len(rows[0]))]
    lines = []
    for n, row in enumerate(rows):
        cells = [
            cell.ljust(width) if k < words else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=False))
        ]
        lines.append("  ".join([*cells, *ends[n : n + 1]]).rstrip())
    return "\n".join(lines)
