"""`slamreplay simulate`: logs whose truth is known."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from slamreplay.cli import completion
from slamreplay.cli.options import Json
from slamreplay.cli.terminal import say_json, say_path
from slamreplay.errors import UsageError
from slamreplay.simulate import SCENARIOS


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(name="simulate", help=_HELP)(_simulate)


_HELP = (
    "Make a log whose truth is known, from a scenario and a seed.\n\nScenarios:\n\n"
    + "\n\n".join(f"{name}: {line}" for name, line in SCENARIOS.items())
)


def _simulate(
    scenario: Annotated[
        str | None,
        typer.Argument(
            metavar="SCENARIO", help="What happens; see above.", autocompletion=completion.scenarios
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="LOG",
            help="The log: .mcap, .db3, .bag, or no suffix for a rosbag2 folder.",
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option("--seed", min=0, help="Seed of every random number; else the scenario's own."),
    ] = None,
    samples: Annotated[
        bool, typer.Option("--samples", help="Make all sample logs anew, in the folder -o.")
    ] = False,
    labels: Annotated[
        list[str] | None,
        typer.Option(
            "--label", metavar="NAME=TEXT", help="Of the log: site=north, robot=amr-07; repeatable."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    from slamreplay.cli.progress import progress_bar

    if output is None:
        raise UsageError("there is no output", hint="name it with -o LOG")
    if samples == (scenario is not None) or (samples and seed is not None):
        raise UsageError(
            "give either a SCENARIO (and a seed) or --samples",
            hint=f"scenarios: {', '.join(SCENARIOS)}",
        )
    if samples and labels:
        raise UsageError("sample logs take no --label")
    named = _labels(labels or [])
    with progress_bar("simulating") as progress:
        from slamreplay.simulate.pipeline import simulate, write_samples

        if scenario is None:
            write_samples(output, progress=progress)
        else:
            from slamreplay.simulate.scenarios import scenario as scenario_of

            seed = scenario_of(scenario).seed if seed is None else seed
            simulate(scenario, output, seed=seed, labels=named)
    if as_json:
        said = {"scenario": scenario, "seed": seed, "log": str(output)}
        say_json({**said, "labels": named} if named else said, indent=None)
    else:
        say_path(output)


def _labels(given: list[str]) -> dict[str, str]:
    from slamreplay.ingest.labels import is_label

    found: dict[str, str] = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not equals or not is_label(name, value):
            hint = "as in --label site=north; a name is of a-z, 0-9 and _"
            raise UsageError("--label takes NAME=TEXT", where=repr(text)[:60], hint=hint)
        if name in found:
            raise UsageError(f"--label {name} is given twice")
        found[name] = value
    return found
