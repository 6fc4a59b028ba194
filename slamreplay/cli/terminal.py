"""What is printed: as wide as the terminal, in quiet colours, obeying nothing that a log says."""

from __future__ import annotations

import codecs
import json
import os
import re
import sys
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Any, TextIO

import typer

from slamreplay.cli.columns import Cell, Line, Piece, Tone, folded, in_columns

if TYPE_CHECKING:
    from rich.console import Console

#: Longer lines are hard to read, however wide the terminal is.
_WIDEST, _WIDEST_TABLE = 100, 120
_STYLES: dict[Tone, str] = {
    "plain": "",
    "head": "bold",
    "good": "bold green",
    "bad": "bold red",
    "doubt": "bold yellow",
    "quiet": "dim",
}
#: Tones that are told by more than a colour.
_MARKS: dict[Tone, str] = {"bad": "!", "doubt": "?"}
#: What stands for characters that the output's encoding has no place for.
_PLAINER = {"±": "+-", "²": "2", "°": " deg", "→": "->", "·": "-"}
# C0 and C1 controls begin the sequences that terminals obey; the others turn the line's direction
# or break it, so that it reads otherwise than it is (Unicode Standard Annex 9, section 2).
_OBEYED = re.compile(
    "[\t\n\r]+|[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)


def safe(text: object) -> str:
    """A line's text that no terminal obeys: control characters are shown as Python writes them."""
    return _OBEYED.sub(_shown, str(text))


def _shown(found: re.Match[str]) -> str:
    blank = found[0][0] in "\t\n\r"
    return " " if blank else found[0].encode("unicode_escape").decode("ascii")


def settle_streams() -> None:
    """Let no character be a fault where the output's encoding, say of a Windows pipe, lacks it."""
    codecs.register_error("slamreplay", _plainer)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="slamreplay")
    # Else numba wraps both by colorama, where that is, which ends with an escape sequence.
    os.environ.setdefault("NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING", "1")


def _plainer(error: UnicodeError) -> tuple[str | bytes, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lost = error.object[error.start]
    plain = _PLAINER.get(lost) or lost.encode("unicode_escape").decode("ascii")
    return plain, error.start + 1


def width_of(stream: TextIO) -> int | None:
    """Columns to lay texts out for; None, which folds nothing, for files and pipes.

    `COLUMNS` in the environment holds for those, too: `watch` and the like set it.
    """
    columns = os.environ.get("COLUMNS", "")
    if columns.isdigit() and int(columns) > 0:
        return int(columns)
    try:
        return os.get_terminal_size(stream.fileno()).columns or 80 if stream.isatty() else None
    except (OSError, ValueError):
        return 80 if stream.isatty() else None


def is_plain() -> bool:
    """Whether the user or the terminal wants no escape sequences (no-color.org)."""
    return bool(os.environ.get("NO_COLOR")) or os.environ.get("TERM") == "dumb"


def say(*pieces: Cell, indent: int = 0, to_stderr: bool = False) -> None:
    """Print a line; where the last piece is too long for it, go on below, `indent` further in."""
    parts: list[Piece] = [p if isinstance(p, tuple) else (p, "plain") for p in pieces]
    *first, (text, tone) = parts or [("", "plain")]
    # What stands before the last piece is as good as the beginning of its first word.
    filler = "\N{NO-BREAK SPACE}" * sum(len(safe(before)) for before, _ in first)
    width = width_of(sys.stderr if to_stderr else sys.stdout)
    room = None if width is None else min(width, _WIDEST)
    head, *rest = folded(filler + safe(text), room, indent)
    lines: list[Line] = [[*first, (head[len(filler) :], tone)], *([(t, tone)] for t in rest)]
    _print(lines, to_stderr=to_stderr)


def say_labelled(label: str, text: str, tone: Tone = "plain", *, column: int) -> None:
    """Print a text behind a label, and below itself where it is longer than the terminal.

    The tone is the label's, and that of a mark before it: a wall of red says less than one word.
    """
    mark = _MARKS.get(tone, " ")
    of_label = tone if mark != " " else "quiet"
    say((f"{mark} {label:<{column}}", of_label), text, indent=column + 2)


def say_table(
    rows: Sequence[Sequence[Cell]],
    *,
    numbers: Collection[int] = (),
    ends: Sequence[str] = (),
    indent: int = 0,
    with_head: bool = True,
) -> None:
    """Print a table, see `in_columns`; the first row is the head."""
    clean: list[list[Cell]] = [
        [(safe(c[0]), c[1]) if isinstance(c, tuple) else safe(c) for c in row] for row in rows
    ]
    width = width_of(sys.stdout)
    room = None if width is None else min(width, _WIDEST_TABLE)
    lines = in_columns(
        clean,
        numbers=numbers,
        ends=[safe(end) for end in ends],
        width=room,
        indent=indent,
        with_head=with_head,
    )
    _print(list(lines))


def say_json(answers: Any, **how: Any) -> None:
    """Print JSON, in UTF-8 whatever the terminal's encoding; a text is taken to be JSON already."""
    text = answers if isinstance(answers, str) else json.dumps(answers, **{"indent": 1, **how})
    typer.echo(f"{text.removesuffix(chr(10))}\n".encode(), nl=False)


def say_path(path: object) -> None:
    """Print a path alone on its line, never folded: scripts take the last line for it."""
    typer.echo(safe(path))


def complain(text: str) -> None:
    """Print one line on stderr, never folded: scripts read it."""
    typer.echo(safe(text), err=True)


def _print(lines: Sequence[Line], *, to_stderr: bool = False) -> None:
    stream = sys.stderr if to_stderr else sys.stdout
    wants_colour = stream.isatty() or bool(os.environ.get("FORCE_COLOR"))
    if is_plain() or not wants_colour:
        for line in lines:
            typer.echo("".join(safe(text) for text, _ in line).rstrip(), err=to_stderr)
        return
    from rich.text import Text

    console = _console(to_stderr=to_stderr)
    for line in lines:
        pieces = [(safe(text), _STYLES[tone]) for text, tone in line]
        console.print(Text.assemble(*pieces, end=""), soft_wrap=True)


def _console(*, to_stderr: bool) -> Console:
    from rich.console import Console

    return Console(stderr=to_stderr, highlight=False, markup=False, emoji=False, soft_wrap=True)
