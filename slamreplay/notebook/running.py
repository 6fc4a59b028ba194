"""Run estimators again: `sr.perturb`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from slamreplay.errors import UsageError
from slamreplay.notebook.evidence import Evidence, found
from slamreplay.notebook.log_bundle import LogBundle
from slamreplay.notebook.progress import Progress, shown
from slamreplay.notebook.runs_value import Runs

if TYPE_CHECKING:
    from slamreplay.replay.parameters import Configuration


def perturb(
    evidence: Evidence,
    perturbations: str | Iterable[str] = (),
    estimators: str | Iterable[str] = (),
    *,
    recipe: str | Path | None = None,
    seed: int = 0,
    parameters: str | Path | Iterable[str | Path] = (),
    robot: str | None = None,
    output: str | Path | None = None,
    workers: int | None = None,
    progress: Progress | bool | None = None,
) -> Runs:
    """Run estimators on a log: each by itself, then with one perturbation at a time.

    What was run before comes from the user's cache.

    Args:
        evidence: what `sr.ingest` gave, or the path of a log or a bundle.
        perturbations: texts `NAME[.VARIANT]=LEVEL` as "tf_delay=0.2"; `sr.list("perturbations")`.
        estimators: names, all that fit by default; `sr.list("estimators")`.
        recipe: a design as a file, instead of perturbations: levels or a search, over seeds.
        seed: of every random number; of a recipe the file says it.
        parameters: YAML files of the estimators, as nav2_params.yaml.
        robot: namespace whose parameters count, where a file has several.
        output: also write the runs here, as `slamreplay perturb -o` does.
        workers: processes; one per core by default where it is worth it.
        progress: told how far it is; True draws a line, False nothing.

    Raises:
        SlamreplayError: what is wrong, where, and what can be done about it, in one line.

    >>> import slamreplay as sr
    >>> runs = sr.perturb("sample_logs/healthy_short.bag", "tf_delay=0.3", "dead_reckoning")
    >>> runs
    <Runs of healthy_short.bag: 2 by dead_reckoning>
    >>> runs.table[["perturbation", "level"]].values.tolist()
    [[None, nan], ['tf_delay.odometry', 0.3]]
    >>> runs.trajectory(1)[["t_s", "x_m"]].shape
    (187, 2)
    """
    from slamreplay.bundle.atomic import check_target
    from slamreplay.caches import cache_folder, run_folder
    from slamreplay.estimators import ESTIMATORS
    from slamreplay.replay.design import design, parse_perturbation, usual_estimators
    from slamreplay.replay.folder import RUNS, write_runs
    from slamreplay.replay.runner import replay

    texts, names = _several(perturbations), _several(estimators)
    if output is not None:
        check_target(Path(output), RUNS, "output=")
    for text in texts:  # before time is spent on reading the log
        parse_perturbation(text)
    for name in names:
        ESTIMATORS.target(name)
    if recipe is not None:
        if texts or seed:
            raise UsageError(
                "the recipe says what is perturbed, and its seed",
                where=recipe,
                hint="leave perturbations and seed out",
            )
        return _designed(
            evidence, Path(recipe), names, parameters, robot, output, workers, progress
        )
    log = found(evidence, {}, progress).log
    given = _configuration(parameters, names or list(ESTIMATORS), robot)
    trials = design(log.bundle, names or usual_estimators(log.bundle), texts, seed, given.of)
    with shown(progress) as tell:
        runs = replay(log.bundle, trials, progress=tell, cache=run_folder(), workers=workers)
    if output is not None:
        keep = log.path is not None and log.path.is_relative_to(cache_folder())
        write_runs(Path(output), log.bundle, runs, keep_bundle=keep)
    return Runs(log, tuple(runs))


def _several(texts: str | Iterable[str]) -> list[str]:
    return [texts] if isinstance(texts, str) else list(texts)


def _configuration(
    parameters: str | Path | Iterable[str | Path], names: Sequence[str], robot: str | None
) -> Configuration:
    from slamreplay.replay.parameters import Configuration, read_parameters

    paths = [parameters] if isinstance(parameters, str | Path) else list(parameters)
    if not paths:
        return Configuration({}, ())
    return read_parameters([Path(path) for path in paths], names, robot)


def _designed(
    evidence: Evidence,
    recipe: Path,
    names: list[str],
    parameters: str | Path | Iterable[str | Path],
    robot: str | None,
    output: str | Path | None,
    workers: int | None,
    progress: Progress | bool | None,
) -> Runs:
    """Runs and answer of a recipe that is a design."""
    from dataclasses import replace

    from slamreplay.caches import cache_folder
    from slamreplay.doses.answer import answer
    from slamreplay.doses.folder import write_answer
    from slamreplay.recipes import DoseRecipe, read_recipe
    from slamreplay.recipes.dose_recipe import check_estimators

    asked = read_recipe(recipe)
    if not isinstance(asked, DoseRecipe):
        raise UsageError(
            "no design of perturbations", where=recipe, hint="slamreplay perturb --recipe runs it"
        )
    plan = asked.plan
    if names:
        check_estimators(names)
        plan = replace(plan, estimators=tuple(names))
    given = _configuration(parameters, list(plan.estimators), robot)
    log: LogBundle = found(evidence, {}, progress).log
    with shown(progress) as tell:
        told = answer(log.bundle, plan, parameters=given.of, cache=cache_folder(),
                      workers=workers, progress=tell)  # fmt: skip
    if output is not None:
        about = {"bundle_id": log.manifest.bundle_id, "scenario": None}
        write_answer(Path(output), log.bundle, plan, told, about, keep_bundle=True,
                     cache=cache_folder())  # fmt: skip
    return Runs(log, told.runs, told.results)
