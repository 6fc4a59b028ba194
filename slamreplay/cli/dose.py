"""What `slamreplay perturb` does with a recipe that is a design: replay, write, print."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slamreplay.cli.options import checked_seed
from slamreplay.cli.terminal import complain, say, say_json, say_table

if TYPE_CHECKING:
    from slamreplay.doses.plan import Plan
    from slamreplay.ingest.options import IngestOptions
    from slamreplay.recipes import DoseRecipe
    from slamreplay.replay.dose import DoseResults


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
    from slamreplay.caches import cache_folder, watch_folder
    from slamreplay.cli.progress import progress_bar
    from slamreplay.cli.scenario import log_or_scenario
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
        complain(line)
    with (
        watched(watch_folder(), output) as watch,
        log_or_scenario(logs, recipe.scenario, how, path) as bundle,
    ):
        with progress_bar("replaying") as progress:
            found = answer(bundle, plan, parameters=given.of, cache=cache_folder(),
                           progress=progress, watch=watch)  # fmt: skip
        log: dict[str, Any] = {"bundle_id": bundle.manifest.bundle_id, "scenario": None}
        if not logs and recipe.scenario is not None:
            log["scenario"] = dict(zip(("name", "seed"), recipe.scenario, strict=True))
        own = bundle.path.resolve() if logs and bundle.path is not None else None
        keep = own is None or own != logs[0].resolve()
        write_answer(output, bundle, plan, found, log, keep_bundle=keep, cache=cache_folder())
    if as_json:
        say_json(results_json(plan, found.results, log))
        return
    _show(found.results, log, found.trials)
    complain(f"runs and results written to {output}")


def _overridden(plan: Plan, estimators: Sequence[str], seed: int | None) -> Plan:
    from slamreplay.recipes.dose_recipe import check_estimators

    if seed is not None:
        first = checked_seed(seed)
        plan = replace(plan, seeds=tuple(range(first, first + len(plan.seeds))))
    if estimators:
        check_estimators(list(estimators))
        plan = replace(plan, estimators=tuple(estimators))
    return plan


def _show(results: DoseResults, log: Mapping[str, Any], trials: int) -> None:
    """Question, every failed control, table, and what broke first."""
    from slamreplay.report.dose_tables import critical_rows, notes, ranking_rows, warning

    failed = [warning(c) for c in results.controls if c.passed is False]
    scenario = log["scenario"]
    of = f"scenario {scenario['name']}, seed {scenario['seed']}; " if scenario else ""
    say((results.question, "head"))
    for line in failed:
        say()
        say((line, "bad"))
    say()
    say(f"critical level: {results.limits[0].title}")
    say_table(critical_rows(results), indent=2)
    say()
    say("what breaks first:")
    say_table(ranking_rows(results), indent=2)
    first, *others = results.seeds
    seeds = f"seeds {first} to {others[-1]}" if others else f"seed {first}"
    say()
    say(f"({of}{trials} trials, {seeds})")
    for note in notes(results):
        if note not in failed:
            say(f"note: {note}", indent=6)
