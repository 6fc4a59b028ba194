"""What `slamreplay perturb` does with a recipe that is a design: replay, write, print."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import typer

from slamreplay.errors import UsageError

if TYPE_CHECKING:
    from slamreplay.bundle.view import Bundle
    from slamreplay.doses.plan import Plan
    from slamreplay.ingest.options import IngestOptions
    from slamreplay.recipes import DoseRecipe
    from slamreplay.replay.dose import DoseResults
    from slamreplay.report.dose_tables import Rows


def run_design(
    recipe: DoseRecipe,
    path: Path,
    output: Path,
    *,
    logs: Sequence[Path],
    how: IngestOptions,
    estimators: Sequence[str],
    parameters: Sequence[Path],
    robot: str | None,
    seed: int | None,
    as_json: bool,
) -> None:
    """Answer a recipe's question on a log.

    Args:
        recipe: the question.
        path: its file, for faults.
        output: RUNS folder to write.
        logs: the log, in place of the recipe's scenario.
        how: to ingest it.
        estimators: in place of the recipe's own.
        parameters: files with parameters of the estimators.
        robot: namespace whose parameters count.
        seed: the first one, in place of the recipe's own.
        as_json: print the results as JSON.

    Raises:
        UsageError: no log and no scenario, or a name that there is not.
    """
    from slamreplay.bundle.atomic import check_target
    from slamreplay.cli.main import cache_folder, watch_folder
    from slamreplay.cli.progress import progress_bar
    from slamreplay.doses.answer import answer
    from slamreplay.doses.folder import write_answer
    from slamreplay.doses.page import results_json
    from slamreplay.replay.folder import RUNS
    from slamreplay.replay.parameters import Configuration, read_parameters
    from slamreplay.replay.watch import watched

    plan = _overridden(recipe.plan, estimators, seed)
    check_target(output, RUNS)
    given = Configuration({}, ())
    if parameters:
        given = read_parameters(parameters, list(plan.estimators), robot)
    for line in given.told:
        typer.echo(line, err=True)
    with (
        watched(watch_folder(), output) as watch,
        _evidence(recipe, path, logs, how) as (bundle, is_kept),
    ):
        with progress_bar("replaying") as progress:
            found = answer(bundle, plan, parameters=given.of, cache=cache_folder(),
                           progress=progress, watch=watch)  # fmt: skip
        log: dict[str, Any] = {"bundle_id": bundle.manifest.bundle_id, "scenario": None}
        if not logs and recipe.scenario is not None:
            log["scenario"] = dict(zip(("name", "seed"), recipe.scenario, strict=True))
        write_answer(output, bundle, plan, found, log, keep_bundle=not is_kept)
    if as_json:
        typer.echo(results_json(plan, found.results, log), nl=False)
        return
    typer.echo(_told(found.results, log, found.trials))
    typer.echo(f"\nruns and results written to {output}", err=True)


def _overridden(plan: Plan, estimators: Sequence[str], seed: int | None) -> Plan:
    from slamreplay.recipes.dose_recipe import check_estimators

    if seed is not None:
        if not 0 <= seed < 2**62:
            raise UsageError(
                f"seed {seed} is negative" if seed < 0 else f"seed {seed} is too large"
            )
        plan = replace(plan, seeds=tuple(range(seed, seed + len(plan.seeds))))
    if estimators:
        check_estimators(list(estimators))
        plan = replace(plan, estimators=tuple(estimators))
    return plan


@contextmanager
def _evidence(
    recipe: DoseRecipe, path: Path, logs: Sequence[Path], how: IngestOptions
) -> Iterator[tuple[Bundle, bool]]:
    """The bundle, and whether it stays where it is after the block."""
    from slamreplay.cli import options
    from slamreplay.cli.main import bundle_folder
    from slamreplay.ingest.options import IngestOptions

    if logs:
        with options.evidence(logs, how, cache=bundle_folder()) as bundle:
            yield bundle, bundle.path is not None and bundle.path.resolve() == logs[0].resolve()
        return
    if recipe.scenario is None:
        raise UsageError("there is no LOG to replay", where=path,
                         hint="name one, or a scenario in the recipe")  # fmt: skip
    if how != IngestOptions():
        raise UsageError(
            "a simulated log takes no --map, --topics, --robot, --reference, --start or --end",
            where=path,
            hint="leave them out, or name a LOG",
        )
    from slamreplay.errors import OutputError
    from slamreplay.ingest.bundle_cache import made_once

    scenario = recipe.scenario
    asked = [f"scenario {scenario}"]
    try:
        bundle = made_once(bundle_folder(), asked, lambda target: _simulated(scenario, target))
    except (OSError, OutputError):  # a cache that cannot be written is not used
        with TemporaryDirectory(prefix="slamreplay-") as folder:
            yield _simulated(scenario, Path(folder) / "log.bundle"), False
        return
    yield bundle, False


def _simulated(scenario: tuple[str, int], target: Path) -> Bundle:
    """The bundle of a scenario with a seed, written to `target`."""
    from slamreplay.cli.progress import progress_bar
    from slamreplay.ingest.pipeline import ingest
    from slamreplay.simulate.pipeline import simulate

    name, seed = scenario
    with TemporaryDirectory(prefix="slamreplay-") as folder, progress_bar("simulating"):
        log = Path(folder) / f"{name}.mcap"
        simulate(name, log, seed=seed)
        return ingest([log], target)


def _told(results: DoseResults, log: Mapping[str, Any], trials: int) -> str:
    """Question, table, what broke first, and every failed control."""
    from slamreplay.report.dose_tables import critical_rows, notes, ranking_rows, warning

    failed = [warning(c) for c in results.controls if c.passed is False]
    scenario = log["scenario"]
    of = f"scenario {scenario['name']}, seed {scenario['seed']}; " if scenario else ""
    lines = [results.question, "", *failed, *([""] if failed else [])]
    lines += [f"critical level: {results.limits[0].title}", _text(critical_rows(results)), ""]
    lines += ["what breaks first:", _text(ranking_rows(results)), ""]
    first, *others = results.seeds
    seeds = f"seeds {first} to {others[-1]}" if others else f"seed {first}"
    lines += [f"({of}{trials} trials, {seeds})"]
    lines += [f"note: {note}" for note in notes(results) if note not in failed]
    return "\n".join(lines)


def _text(rows: Rows) -> str:
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return "\n".join(
        "  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    )
