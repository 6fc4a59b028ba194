"""`slamreplay explain`: what a finding means."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer

from slamreplay.catalogue import explanation_of
from slamreplay.cli import completion
from slamreplay.cli.options import Json
from slamreplay.cli.terminal import say, say_json, say_labelled


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(name="explain", help="Say what a finding asks, how, and when it misleads.")(
        _explain
    )


def _explain(
    id_: Annotated[
        str,
        typer.Argument(
            metavar="ID", help="A finding's id, as SR-LOC-001.", autocompletion=completion.findings
        ),
    ],
    as_json: Json = False,
) -> None:
    name, explanation = explanation_of(id_)
    if as_json:
        say_json({"id": name, **asdict(explanation)})
        return
    say((f"{name}  {explanation.title}", "head"), indent=len(name) + 2)
    for head, text in (
        ("it asks", explanation.asks),
        ("how", explanation.method),
        ("it misleads", explanation.misleads),
    ):
        say_labelled(head, text, column=13)
