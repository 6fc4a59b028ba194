"""`slamreplay bench`: how often the verdict is right on logs whose truth is known."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from slamreplay.cli.options import Json, Seed
from slamreplay.cli.terminal import complain, say_json
from slamreplay.errors import UsageError

Output = Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder to write.")]
Train = Annotated[
    bool, typer.Option("--train", help="Play the seeds that are there to develop with.")
]
Kind = Annotated[
    list[str] | None, typer.Option("--kind", help="Only this kind; several by repeating it.")
]
AtLeast = Annotated[
    list[str] | None,
    typer.Option("--at-least", metavar="FIGURE=NUMBER", help="Exit with 1 where it is lower."),
]
Jobs = Annotated[int, typer.Option("--jobs", min=1, help="Processes.")]


def register(app: typer.Typer) -> None:
    """Add the command."""
    group = typer.Typer(help="Benchmarks on simulated logs of known truth.", rich_markup_mode=None)
    group.command("verdict")(verdict)
    group.command("causes")(causes)
    app.add_typer(group, name="bench")


def verdict(
    output: Output,
    seed: Seed = 0,
    logs: Annotated[
        int | None, typer.Option("--logs", min=1, help="How many logs; 312 by default.")
    ] = None,
    train: Train = False,
    kind: Kind = None,
    condition: Annotated[
        list[str] | None,
        typer.Option("--condition", help="Only this condition; several by repeating it."),
    ] = None,
    reports: Annotated[
        bool, typer.Option("--reports", help="Write the report of every log judged wrongly.")
    ] = False,
    at_least: AtLeast = None,
    at_most: Annotated[
        list[str] | None,
        typer.Option("--at-most", metavar="FIGURE=NUMBER", help="Exit with 1 where it is higher."),
    ] = None,
    jobs: Jobs = 2,
    as_json: Json = False,
) -> None:
    """Judge simulated incidents of every kind and compare with the truth.

    Writes results.json, results.md and the reliability diagram; a run that was stopped goes on
    where it was. Held seeds are played unless --train is given: nothing of the program is tuned on
    those. A FIGURE is a path into the scores of results.json, as log_accuracy or lost.f1.
    """
    from slamreplay.bench.conditions import CONDITIONS
    from slamreplay.bench.goals import missed, parse_goals
    from slamreplay.bench.incidents import KINDS
    from slamreplay.bench.runner import PAGE, run_benchmark
    from slamreplay.bench.schedule import DEFAULT_LOGS
    from slamreplay.bench.table import page
    from slamreplay.cli.progress import progress_bar

    _check(kind, KINDS)
    _check(condition, CONDITIONS)
    goals = [*parse_goals(at_least or [], ">="), *parse_goals(at_most or [], "<=")]
    is_chosen = bool(kind or condition)
    with progress_bar("benchmark") as progress:
        results = run_benchmark(
            output,
            logs=logs or DEFAULT_LOGS,
            seed=seed,
            split="train" if train else "held",
            kinds=kind or (() if is_chosen else KINDS),
            conditions=condition or (() if is_chosen else tuple(CONDITIONS)),
            jobs=jobs,
            reports=reports,
            progress=progress,
        )
    figures = results["scores"]
    _tell(figures, None if as_json else page(results), output / PAGE, missed(figures, goals))


def causes(
    output: Output,
    seed: Seed = 0,
    logs: Annotated[
        int | None, typer.Option("--logs", min=1, help="How many logs; 230 by default.")
    ] = None,
    train: Train = False,
    kind: Kind = None,
    by: Annotated[
        list[str] | None,
        typer.Option("--by", help="Who names the causes; all by default, several by repeating it."),
    ] = None,
    at_least: AtLeast = None,
    jobs: Jobs = 2,
    as_json: Json = False,
) -> None:
    """Name the root causes of simulated incidents whose single cause is known.

    Writes results.json, results.md, and the confusion matrix as a picture; a run that was stopped
    goes on where it was. Held seeds are played unless --train is given. A FIGURE is a path into the
    answerers of results.json, as rules.accuracy.
    """
    from slamreplay.bench.cause_answers import ANSWERERS
    from slamreplay.bench.cause_runner import DEFAULT_LOGS, run_causes
    from slamreplay.bench.cause_table import causes_page
    from slamreplay.bench.goals import missed, parse_goals
    from slamreplay.bench.incidents import ALL_KINDS
    from slamreplay.bench.runner import PAGE
    from slamreplay.cli.progress import progress_bar

    _check(kind, ALL_KINDS)
    _check(by, ANSWERERS)
    goals = parse_goals(at_least or [], ">=")
    with progress_bar("benchmark") as progress:
        results = run_causes(
            output,
            logs=logs or DEFAULT_LOGS,
            seed=seed,
            split="train" if train else "held",
            kinds=kind or ALL_KINDS,
            answerers=by or tuple(ANSWERERS),
            jobs=jobs,
            progress=progress,
        )
    figures = results["answerers"]
    _tell(figures, None if as_json else causes_page(results), output / PAGE, missed(figures, goals))


def _check(given: list[str] | None, known: Iterable[str]) -> None:
    for name in given or ():
        if name not in known:
            raise UsageError(f"there is no '{name}'", hint=", ".join(known))


def _tell(figures: dict[str, Any], text: str | None, page: Path, lines: list[str]) -> None:
    """The figures as JSON or as text; then the goals that were missed, which make the exit code."""
    if text is None:
        say_json(figures, allow_nan=False, sort_keys=True)
    else:
        typer.echo(text)
        complain(str(page))
    for line in lines:
        complain(line)
    if lines:
        raise typer.Exit(1)
