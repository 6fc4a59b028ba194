"""Texts and tables laid out for a terminal of some width; no word is ever cut.

Without a width, as in a pipe, each text and each row of a table is one line, however long.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from typing import Literal

from rich.cells import cell_len

Tone = Literal["plain", "head", "good", "bad", "doubt", "quiet"]
Piece = tuple[str, Tone]
#: A line of a terminal: texts one after the other, each in its tone.
Line = list[Piece]
Cell = str | Piece

_GAP = "  "
#: A column of words is made narrower than its widest cell, but not than this.
_NARROWEST = 20
# A number and the short word behind it, mostly a unit, stay together.
_QUANTITY = re.compile(r"(?<=\d) (?=\S{1,3}(?: |$))")


def folded(text: str, width: int | None, indent: int = 0) -> list[str]:
    """A text as lines of at most `width`, broken at spaces; a longer word has a line of its own.

    Args:
        text: without line breaks.
        width: None takes all of it as one line.
        indent: spaces before every line but the first, which are part of the width.
    """
    if width is None:
        return [text]
    lines: list[str] = []
    body = text.lstrip(" ")
    line, has_word = " " * (len(text) - len(body)), False
    for word in _QUANTITY.sub("\N{NO-BREAK SPACE}", body).split(" "):
        if has_word and cell_len(line) + 1 + cell_len(word) > width:
            lines.append(line)
            line = " " * indent + word
        else:
            line = f"{line} {word}" if has_word else line + word
        has_word = True
    return [each.replace("\N{NO-BREAK SPACE}", " ") for each in (*lines, line)]


def in_columns(
    rows: Sequence[Sequence[Cell]],
    *,
    numbers: Collection[int] = (),
    ends: Sequence[str] = (),
    width: int | None = None,
    indent: int = 0,
    with_head: bool = True,
) -> Iterator[Line]:
    """A table: side by side where the width allows, else folded, else one block for each row.

    Args:
        rows: the first one is the head; a row may have fewer cells than that.
        numbers: columns that are flush right and never folded; the others hold words.
        ends: a text behind each row, which widens no column.
        width: of the terminal.
        indent: spaces before every line.
        with_head: whether the head is printed; without, it still names cells in blocks.
    """
    table = [[cell if isinstance(cell, tuple) else (cell, "plain") for cell in row] for row in rows]
    table[0] = [(text, "head") for text, _ in table[0]]
    room = None if width is None else width - indent - len(_GAP) * (len(table[0]) - 1)
    widths = _widths(table, numbers, room)
    margin: Piece = (" " * indent, "plain")
    for n, row in enumerate(table):
        if n == 0 and not with_head:
            continue
        end = ends[n] if n < len(ends) else ""
        if widths is None:
            block = _stacked(table[0], row, numbers, (width or 0) - indent) if n else []
        else:
            block = _side_by_side(row, widths, numbers)
        yield from ([margin, *line] for line in _with_end(block, end, width, indent))


def _with_end(block: list[Line], end: str, width: int | None, indent: int) -> list[Line]:
    if not end:
        return block
    last = sum(cell_len(text) for text, _ in block[-1]) if block else 0
    if width is None or indent + last + len(_GAP) + cell_len(end) <= width:
        return [*block[:-1], [*block[-1], (f"{_GAP}{end}", "plain")]]
    below: list[Line] = [[(f"    {part}", "plain")] for part in folded(end, width - indent - 4)]
    return [*block, *below]


def _widths(table: Sequence[Line], numbers: Collection[int], room: int | None) -> list[int] | None:
    """Of the columns; None where they do not fit side by side."""
    columns = range(len(table[0]))
    cells = [[row[k][0] for row in table if k < len(row)] for k in columns]
    natural = [max(map(cell_len, column)) for column in cells]
    if room is None or sum(natural) <= room:
        return natural
    least = []
    for k, (head, *texts) in enumerate(cells):
        longest = max(map(_longest_word, (head, *texts)))
        if k in numbers:
            longest = max([longest, *map(cell_len, texts)])
        else:
            longest = max(longest, min(natural[k], _NARROWEST))
        least.append(longest)
    if sum(least) > room:
        return None
    # The widest columns give way first: all get what they need up to a cap that just fits.
    cap = max(natural)
    while (
        sum(fitted := [max(lo, min(n, cap)) for lo, n in zip(least, natural, strict=True)]) > room
    ):
        cap -= 1
    return fitted


def _longest_word(text: str) -> int:
    return max(cell_len(part) for part in _QUANTITY.sub("\N{NO-BREAK SPACE}", text).split(" "))


def _side_by_side(row: Line, widths: Sequence[int], numbers: Collection[int]) -> list[Line]:
    parts = [folded(text, width) for (text, _), width in zip(row, widths, strict=False)]
    block: list[Line] = []
    for n in range(max(map(len, parts))):
        line: Line = []
        for k, part in enumerate(parts):
            text = part[n] if n < len(part) else ""
            space = " " * (widths[k] - cell_len(text))
            before = _GAP if k else ""
            is_last = k == len(parts) - 1
            if k in numbers:
                line.append((f"{before}{space}{text}", row[k][1]))
            else:
                line.append((f"{before}{text}{'' if is_last else space}", row[k][1]))
        block.append(_stripped(line))
    return block


def _stripped(line: Line) -> Line:
    """Without spaces at its end."""
    line = list(line)
    while line and not line[-1][0].rstrip():
        line.pop()
    return [*line[:-1], (line[-1][0].rstrip(), line[-1][1])] if line else [("", "plain")]


def _stacked(head: Line, row: Line, numbers: Collection[int], width: int) -> list[Line]:
    """A row as a block: what it is, and below that each cell behind its column's name."""
    titles = min(numbers, default=1)
    named = [cell for cell in row[:titles] if cell[0]]
    tone: Tone = next((tone for _, tone in named if tone != "plain"), "head")
    title = _GAP.join(text for text, _ in named)
    block: list[Line] = [[(text, tone)] for text in folded(title, width, 4)]
    line: Line = []
    used = 0
    for (name, _), (text, of_cell) in zip(head[titles:], row[titles:], strict=False):
        if text in ("", "-"):
            continue
        pair = f"{name} {text}".strip()
        if not numbers or (used and used + len(_GAP) + cell_len(pair) > width):
            block.append(line)
            line, used = [], 0
        first, *rest = folded(pair, width - 2, 2)
        line.append((f"  {first}", of_cell))
        used += len(_GAP) + cell_len(first)
        for part in rest:
            block.append(line)
            line, used = [(f"  {part}", of_cell)], width
    return [each for each in (*block, line) if each]
