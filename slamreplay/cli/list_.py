"""`slamreplay list`: what there is of each kind."""

from __future__ import annotations

from itertools import groupby
from typing import Annotated

import typer

from slamreplay.catalogue import KINDS, catalogue
from slamreplay.cli import completion
from slamreplay.cli.options import Json
from slamreplay.cli.terminal import say, say_json, say_table


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(name="list", help=f"List what there is: {', '.join(KINDS)}.")(_list)


def _list(
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND", help=f"One of {', '.join(KINDS)}.", autocompletion=completion.kinds
        ),
    ],
    as_json: Json = False,
) -> None:
    rows = catalogue(kind)
    if as_json:
        say_json(rows)
        return
    if kind == "perturbations":
        _show_grouped(rows)
        return
    columns = list(rows[0]) if rows else []
    heads = ["" if key == "doc" else key for key in columns]
    say_table([heads, *([str(row[key]) for key in columns] for row in rows)], with_head=False)


def _show_grouped(rows: list[dict[str, object]]) -> None:
    """Print each perturbation with what it touches, and below it what its levels mean."""
    say("NAME.VARIANT=LEVEL; of the level: unit, what changes nothing, least to greatest")
    groups = [(name, list(group)) for name, group in groupby(rows, _perturbation_of)]
    # One width for all groups, so that their columns stand below each other.
    wide, long = (max(len(text) for text in texts) for texts in zip(
        *((str(row["name"]), _level(row)) for row in rows), strict=True))  # fmt: skip
    for name, group in groups:
        say()
        say((f"{name}:", "head"), f" {group[0]['about']}", indent=2)
        say("  ", (f"changes {_touched(group[0])}", "quiet"), indent=4)
        rows_of = [[f"{row['name']!s:<{wide}}", f"{_level(row):<{long}}", str(row["doc"])]
                   for row in group]  # fmt: skip
        say_table([["", "", ""], *rows_of], indent=2, with_head=False)


def _perturbation_of(row: dict[str, object]) -> str:
    return str(row["name"]).partition(".")[0]


def _touched(row: dict[str, object]) -> str:
    """Tables, and the estimators' settings."""
    from slamreplay.bundle.schema import TABLES

    touches = row["touches"]
    assert isinstance(touches, list)
    settings = [t for t in touches if t not in TABLES and t != "map"]
    evidence = [t for t in touches if t not in settings]
    return f"{', '.join(evidence)}{'settings ' * bool(settings)}{', '.join(settings)}"


def _level(row: dict[str, object]) -> str:
    """Unit, baseline and range of a variant's level: "m, 0 (-10 to 10)"."""
    if row["is_switch"]:
        return "0 or 1"
    to = f"{row['low']:g} up" if row["high"] is None else f"{row['low']:g} to {row['high']:g}"
    return f"{row['unit']}, {row['baseline']:g} ({to})"
