"""`slamreplay perturb`: run estimators again, undisturbed and with one thing changed at a time."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from slamreplay.cli import completion, options
from slamreplay.cli.terminal import complain, say_json, say_table
from slamreplay.errors import UsageError

if TYPE_CHECKING:
    from slamreplay.bundle.run import Run
    from slamreplay.bundle.view import Bundle
    from slamreplay.replay.metrics import Metrics

Estimators = Annotated[
    list[str] | None,
    typer.Option(
        "--estimator",
        "-e",
        metavar="NAME",
        help="Estimator; several by repeating it.",
        autocompletion=completion.estimators,
    ),
]
Perturbations = Annotated[
    list[str] | None,
    typer.Option(
        "--perturbation",
        "-p",
        metavar="NAME[.VARIANT]=LEVEL",
        help="One change, e.g. tf_delay=0.2; several by repeating it, each run by itself.",
        autocompletion=completion.perturbations,
    ),
]
Parameters = Annotated[
    list[Path] | None,
    typer.Option(
        "--parameters",
        metavar="YAML",
        help="Parameters of the estimators, as nav2_params.yaml or of rosparam; several by "
        "repeating it, the later holds.",
    ),
]
Logs = Annotated[
    list[Path] | None,
    typer.Argument(
        metavar="LOG",
        help="Log or bundle, as of the other commands; none with a recipe that simulates its own.",
        show_default=False,
    ),
]
Recipe = Annotated[
    Path | None,
    typer.Option(
        "--recipe",
        metavar="YAML",
        help="A question as a file, as in recipes/.",
        autocompletion=completion.recipes,
    ),
]
Output = Annotated[Path, typer.Option("-o", "--output", metavar="RUNS", help="Folder to write.")]
Seed = Annotated[
    int | None,
    typer.Option(
        "--seed",
        help="Seed of every random number, the first one of several; 0, or the recipe's own.",
    ),
]

_POSES = (("poses", "rows_with_pose"),)
_FROM_BASELINE = (
    ("median [m]", "baseline_median_m"),
    ("max [m]", "baseline_max_m"),
    ("end [m]", "baseline_final_m"),
    ("max [rad]", "baseline_max_rad"),
)
_REFERENCE = (("rmse to ref. [m]", "reference_rmse_m"),)
_ALIGNED = (("ATE aligned [m]", "ate_aligned_m"),)
_NEES = (("mean NEES", "nees_mean"), ("by chance (95 %)", "nees_interval"))
_RELATIONS = (("relations [m]", "relations_m"), ("relations [rad]", "relations_rad"))
#: Columns, and the number without which in any row they are left out.
_GROUPS = (
    (_POSES, "rows"),
    (_REFERENCE, "reference_rmse_m"),
    (_ALIGNED, "ate_aligned_m"),
    (_NEES, "nees_mean"),
    (_RELATIONS, "relations_n"),
)
_FINE = {key for _, key in _RELATIONS}


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("perturb")(perturb)


def perturb(
    output: Output,
    logs: Logs = None,
    recipe: Recipe = None,
    perturbations: Perturbations = None,
    estimators: Estimators = None,
    parameters: Parameters = None,
    seed: Seed = None,
    map_yaml: options.MapYaml = None,
    topics: options.Topics = None,
    robot: options.Robot = None,
    reference: options.Reference = None,
    start_s: options.Start = None,
    end_s: options.End = None,
    as_json: options.Json = False,
) -> None:
    """Run estimators on a log: each by itself, then with one perturbation at a time.

    The table shows how far each run is from the undisturbed run of the same estimator. Each run is
    kept as soon as it is done: after an interruption the same command goes on from there, and
    inspect shows meanwhile how far it is.

    A recipe that is a design says which levels of which perturbations are tried, or searches for
    the level at which an estimator breaks; its answer lies beside the runs. One that is a budget
    asks how old poses were in the LOG, or in the scenario it names; one that is a lab simulates
    what it needs and takes no LOG. Both write their answer to the folder.
    """
    how = options.ingest_options(
        map_yaml=map_yaml,
        topics=topics,
        robot=robot,
        reference=reference,
        start_s=start_s,
        end_s=end_s,
    )
    if recipe is not None:
        from slamreplay.cli.recipe import Given, run_recipe

        ingested = {
            "--map": map_yaml,
            "--topics": topics,
            "--robot": robot,
            "--reference": reference,
            "--start": start_s,
            "--end": end_s,
        }
        asked = Given(
            logs or (),
            how,
            perturbations or (),
            estimators or (),
            parameters or (),
            robot,
            seed,
            [name for name, value in ingested.items() if value is not None],
        )
        run_recipe(recipe, output, asked, as_json=as_json)
        return
    if not logs:
        raise UsageError("there is no LOG to replay", hint="name one, or a lab with --recipe")
    from slamreplay.bundle.atomic import check_target
    from slamreplay.bundle.kept import kept
    from slamreplay.caches import bundle_folder, cache_folder, run_folder, watch_folder
    from slamreplay.cli.progress import progress_bar
    from slamreplay.estimators import ESTIMATORS
    from slamreplay.replay.design import design, parse_perturbation, usual_estimators
    from slamreplay.replay.folder import RUNS, write_runs
    from slamreplay.replay.parameters import Configuration, read_parameters
    from slamreplay.replay.run_cache import run_key
    from slamreplay.replay.runner import Replayer
    from slamreplay.replay.watch import watched

    first_seed = options.checked_seed(seed or 0)
    check_target(output, RUNS)
    for text in perturbations or ():  # before minutes are spent on reading the log
        parse_perturbation(text)
    chosen = estimators or list(ESTIMATORS)
    for name in chosen:
        ESTIMATORS.target(name)
    given = read_parameters(parameters, chosen, robot) if parameters else Configuration({}, ())
    for line in given.told:
        complain(line)
    with (
        watched(watch_folder(), output) as watch,
        options.evidence(logs, how, cache=bundle_folder()) as bundle,
    ):
        names = estimators or usual_estimators(bundle)
        trials = design(bundle, names, perturbations or (), first_seed, given.of)
        with (
            progress_bar("replaying") as progress,
            Replayer(bundle, progress=progress, cache=run_folder(), watch=watch) as replayer,
        ):
            runs = replayer.replay(trials)
        is_raw = bundle.path is None or bundle.path.resolve() != logs[0].resolve()
        write_runs(output, bundle, runs, keep_bundle=is_raw)
        told = [text for run in runs for text in (run_key(run.trial), str(run.not_applicable))]
        rows = json.loads(
            kept(cache_folder() / "numbers", told, lambda: json.dumps(_rows(bundle, runs)).encode())
        )
    if as_json:
        say_json({"runs": str(output), "trials": rows}, allow_nan=False)
        return
    _show(rows)
    complain(f"runs written to {output}")


def _rows(bundle: Bundle, runs: Sequence[Run]) -> list[dict[str, Any]]:
    from slamreplay.report.metrics import metrics_of_runs

    return [
        {
            "estimator": run.trial.estimator,
            "perturbation": run.trial.perturbation,
            "level": run.trial.level,
            "unit": run.trial.unit,
            "parameters": run.trial.given,
            "not_applicable": run.not_applicable,
            "metrics": metrics,
        }
        for run, metrics in zip(runs, metrics_of_runs(bundle, runs), strict=True)
    ]


def _show(rows: list[dict[str, Any]]) -> None:
    """Print the trials: every estimator's baseline, and below it what changes from it."""
    order = list(dict.fromkeys(str(row["estimator"]) for row in rows))
    is_compared = any(row["perturbation"] for row in rows)
    columns = list(_FROM_BASELINE) if is_compared else []
    for group, key in _GROUPS:
        columns += group if any(row["metrics"][key] for row in rows) else ()
    lines = [["estimator", "perturbation", "level", *(title for title, _ in columns)]]
    reasons = [""]
    for row in sorted(rows, key=lambda row: order.index(str(row["estimator"]))):
        level = "" if row["level"] is None else f"{row['level']:g} {row['unit']}"
        line = [str(row["estimator"]), str(row["perturbation"] or "(baseline)"), level]
        reason = row["not_applicable"]
        line += [] if reason else [_number(row["metrics"], key) for _, key in columns]
        lines.append(line)
        reasons.append(f"not applicable: {reason}" if reason else "")
    say_table(lines, numbers=range(3, len(lines[0])), ends=reasons)


def _number(metrics: Metrics, key: str) -> str:
    if key == "nees_interval":
        low, high = metrics["nees_low"], metrics["nees_high"]
        return "-" if low is None or high is None else f"{low:.2f} to {high:.2f}"
    value = metrics[key]
    if value is None:
        return "-"
    return f"{value:.{0 if key == 'rows_with_pose' else 4 if key in _FINE else 3}f}"
