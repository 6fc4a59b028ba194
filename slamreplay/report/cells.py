"""A table of the page: cells under a head, and what was left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: Rows of one table on the page; a file beside it has them all.
MOST_ROWS = 40


@dataclass(frozen=True)
class Cell:
    """A cell's text, and a smaller line under it.

    Attributes:
        text: all of it.
        aside: the smaller line.
        links: parts of the text with where they lead, where they lead anywhere.
    """

    text: str
    aside: str = ""
    links: tuple[tuple[str, str], ...] = ()

    @property
    def width(self) -> str:
        """How the cell wraps: short texts stay on one line, long ones get room."""
        return "long" if len(self.text) > 28 else "short"


@dataclass(frozen=True)
class Table:
    """Cells under a head, how many rows were left out, and the file that has them."""

    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    more: int = 0
    more_in: str = "report.json"


def table(
    head: tuple[str, ...], rows: Sequence[Sequence[str | Cell]], more_in: str = "report.json"
) -> Table:
    """A table of the first rows; the rest is counted, and named the file that has it.

    Nothing is left out of a table that no file has: `more_in` is empty then.
    """
    most = MOST_ROWS if more_in else len(rows)
    shown = tuple(
        tuple(cell if isinstance(cell, Cell) else Cell(cell) for cell in row) for row in rows[:most]
    )
    return Table(head, shown, len(rows) - len(shown), more_in)
