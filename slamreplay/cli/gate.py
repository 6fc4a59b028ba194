"""`slamreplay gate`: do logs still fare as they must? For a job of CI to stand on."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from slamreplay.cli import completion, options
from slamreplay.cli.terminal import complain, say_json, say_path
from slamreplay.errors import OutputError, UsageError

if TYPE_CHECKING:
    from slamreplay.gate.outcome import GateResult
    from slamreplay.gate.rules import Demands

Logs = Annotated[
    list[Path],
    typer.Argument(
        metavar="LOG...", help="Logs or bundles, each by itself; a split log as its folder."
    ),
]
Recipe = Annotated[
    Path,
    typer.Option(
        "--recipe",
        metavar="YAML",
        help="What must be found, what must not, and limits.",
        autocompletion=completion.gates,
    ),
]
Output = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="DIR", help="Folder for reports and all files below."),
]
BaselineFile = Annotated[
    Path | None,
    typer.Option(
        "--baseline",
        metavar="JSON",
        help="baseline.json of an earlier run, to be compared with.",
    ),
]
Junit = Annotated[Path | None, typer.Option("--junit", metavar="XML", help="Write JUnit XML here.")]
Sarif = Annotated[
    Path | None, typer.Option("--sarif", metavar="FILE", help="Write SARIF 2.1.0 here.")
]
Gitlab = Annotated[
    Path | None,
    typer.Option("--gitlab", metavar="JSON", help="Write GitLab's code quality report here."),
]
Github = Annotated[
    bool,
    typer.Option(
        "--github", help="Print annotations, and add to the job's summary, of GitHub Actions."
    ),
]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("gate")(gate)


def gate(
    logs: Logs,
    recipe: Recipe,
    output: Output = None,
    baseline: BaselineFile = None,
    junit: Junit = None,
    sarif: Sarif = None,
    gitlab: Gitlab = None,
    github: Github = False,
    map_yaml: options.MapYaml = None,
    topics: options.Topics = None,
    robot: options.Robot = None,
    cause: options.Cause = True,
    as_json: options.Json = False,
) -> None:
    """Hold each log against a recipe's demands.

    Exits with 0 if every log passes, with 1 if a check failed, and with 2 if a log could not be
    read: the others are judged and all files written all the same. What a log does not let be
    assessed is skipped; one of which nothing could be assessed fails.
    """
    from slamreplay.bundle.atomic import check_target
    from slamreplay.cli.gate_run import MARKER, Gating, judged
    from slamreplay.cli.gate_shown import show_result
    from slamreplay.gate.baseline import read_baseline
    from slamreplay.recipes import read_demands

    # All this before the work, not after it.
    if as_json and github:
        raise UsageError("--json and --github both print on stdout", hint="write the JSON by -o")
    demands = read_demands(recipe)
    before = None if baseline is None else read_baseline(baseline)
    if output is not None:
        check_target(output, MARKER)
    files = {path: how for path, how in ((junit, "junit"), (sarif, "sarif"), (gitlab, "gitlab"))
             if path is not None}  # fmt: skip
    for path in files:
        _check_file(path)
    names = [log.as_posix() for log in logs]
    twice = next((name for k, name in enumerate(names) if name in names[:k]), None)
    if twice is not None:
        raise UsageError("the same log is named twice", where=twice)
    _warn_of_patterns(demands, names)
    how = options.ingest_options(
        map_yaml=map_yaml, topics=topics, robot=robot, reference=None, start_s=None, end_s=None
    )
    gating = Gating(demands, recipe.as_posix(), how, cause, before,
                    "" if baseline is None else baseline.as_posix())  # fmt: skip
    with _quoting(github):
        done = judged(logs, gating, output)
        for path, kind in files.items():
            _write(path, done.result, kind)
        if as_json:
            say_json(done.json)
        else:
            show_result(done.result)
    _end(done.result, None if as_json or output is None else output / MARKER, github)
    if done.fault is not None:
        raise done.fault
    if done.result.exit_code:
        raise typer.Exit(done.result.exit_code)


def _check_file(path: Path) -> None:
    if path.is_dir() or not path.absolute().parent.is_dir():
        why = "is a folder" if path.is_dir() else "its folder is not there"
        raise OutputError(why, where=path, hint="name a file in a folder that exists")


def _write(path: Path, result: GateResult, kind: str) -> None:
    from slamreplay.bundle.atomic import write_file
    from slamreplay.cli.gate_run import WRITERS

    write_file(path, WRITERS[kind](result).encode())
    complain(f"{kind}: {path}")


def _warn_of_patterns(demands: Demands, names: list[str]) -> None:
    """Say which rules are of no log: a pattern that is misspelt would go unnoticed."""
    for pattern in demands.of_logs:
        only = replace(demands, of_logs={pattern: demands.of_logs[pattern]})
        if all(only.rules_of(name) is demands.rules for name in names):
            complain(f"the recipe's rules of {pattern!r} are of none of these logs")


@contextmanager
def _quoting(github: bool) -> Iterator[None]:
    """While this holds no text of a log is taken for a command by the runner of GitHub Actions."""
    from slamreplay.gate.github import commands_stopped

    if not github:
        yield
        return
    with commands_stopped(partial(typer.echo, nl=False)):
        yield


def _end(result: GateResult, path: Path | None, github: bool) -> None:
    """What GitHub reads, and last of all the path, alone, for scripts."""
    if github:
        _tell_github(result)
    if path is not None:
        say_path(path)


def _tell_github(result: GateResult) -> None:
    from slamreplay.gate.github import annotations, artifacts_of
    from slamreplay.gate.step_summary import step_summary

    typer.echo(annotations(result), nl=False)
    summary = os.environ.get("GITHUB_STEP_SUMMARY")
    if not summary:
        complain("GITHUB_STEP_SUMMARY is not set: the summary is written by -o only")
        return
    try:
        with Path(summary).open("a", encoding="utf-8") as stream:
            stream.write(step_summary(result, artifacts=artifacts_of(os.environ)))
    except OSError as error:
        complain(f"{summary}: cannot add the summary: {error.strerror or error}")
