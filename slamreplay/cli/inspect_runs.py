"""What `slamreplay inspect` says of a folder of runs: made, being made, or left half done."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slamreplay.cli.terminal import say, say_json, say_table

if TYPE_CHECKING:
    from slamreplay.bundle.run import Run
    from slamreplay.bundle.view import Bundle
    from slamreplay.replay.watch import TrialState, Watched

#: Numbers of a trial that are shown, with the heads of their columns.
_COLUMNS = (
    ("poses", "rows_with_pose", 0),
    ("median [m]", "baseline_median_m", 3),
    ("max [m]", "baseline_max_m", 3),
    ("max [rad]", "baseline_max_rad", 3),
    ("rmse to ref. [m]", "reference_rmse_m", 3),
)


def answers_of(path: Path) -> dict[str, Any] | None:
    """What is known of a folder of runs; None where `path` is, and is becoming, no such thing.

    A batch that runs says more than the folder of an earlier one that it will replace.

    Raises:
        BundleError: a folder of runs that is damaged.
    """
    from slamreplay.caches import watch_folder
    from slamreplay.replay.folder import is_runs, read_runs
    from slamreplay.replay.watch import TrialState, look

    found = look(watch_folder(), path)
    if found is not None and (found.is_running or not is_runs(path)):
        return _under_way(found)
    if not is_runs(path):
        return None
    bundle, runs = read_runs(path)
    states = [TrialState(run.trial, "done") for run in runs]
    return _answers(path, "finished", None, states, runs, bundle)


def _under_way(found: Watched) -> dict[str, Any]:
    from slamreplay.bundle.run import read_run
    from slamreplay.bundle.view import Bundle
    from slamreplay.errors import BundleError

    runs, states = [], []
    for state in found.trials:
        with suppress(BundleError):  # not there, or damaged: it is done again when it is needed
            runs += [] if state.run is None else [read_run(state.run)]
        if runs and runs[-1].trial == state.trial:
            states.append(replace(state, state="done"))
        elif state.state == "waiting" or found.is_running:
            states.append(state)
        else:  # what ran is lost, and what was done and is gone, too
            states.append(replace(state, state="waiting", seconds=None))
    try:
        bundle = Bundle.open(found.bundle)
    except BundleError:
        bundle = None  # it went with the process that made it
    word = "running" if found.is_running else "interrupted"
    return _answers(found.output, word, found.left_s, states, runs, bundle)


def _answers(
    output: Path,
    state: str,
    left_s: float | None,
    states: Sequence[TrialState],
    runs: Sequence[Run],
    bundle: Bundle | None,
) -> dict[str, Any]:
    from slamreplay.replay.metrics import trial_metrics

    run_of = {run.trial: run for run in runs}
    rows = []
    for each in states:
        run = run_of.get(each.trial)
        rows.append({
            "estimator": each.trial.estimator,
            "perturbation": each.trial.perturbation,
            "level": each.trial.level,
            "unit": each.trial.unit,
            "seed": each.trial.seed,
            "state": each.state,
            "seconds": each.seconds,
            "not_applicable": None if run is None else run.not_applicable,
            "metrics": None if run is None or bundle is None else trial_metrics(run, runs, bundle),
        })  # fmt: skip
    return {"runs": str(output), "state": state, "left_s": left_s, "trials": rows}


def show_runs(answers: dict[str, Any], *, as_json: bool) -> None:
    """Print the answers on stdout."""
    if as_json:
        say_json(answers, allow_nan=False)
        return
    rows = answers["trials"]
    count = {s: sum(row["state"] == s for row in rows) for s in ("done", "running", "waiting")}
    told = f"{count['done']} of {len(rows)} trials done"
    if answers["state"] == "running":
        left = answers["left_s"]
        told += f", {count['running']} running, {count['waiting']} waiting, "
        told += "time left not known yet" if left is None else f"about {_duration(left)} left"
    elif answers["state"] == "interrupted":
        told += " and kept; the same command goes on from there"
    say(f"{answers['runs']}: {answers['state']}, {told}")
    say()
    columns = [c for c in _COLUMNS if any((row["metrics"] or {}).get(c[1]) for row in rows)]
    with_state = answers["state"] != "finished"
    head = ["estimator", "perturbation", "level", "seed", *["state"] * with_state]
    lines = [[*head, *(title for title, _, _ in columns)]]
    lines += [_line(row, columns, with_state=with_state) for row in rows]
    reasons = [row["not_applicable"] for row in rows]
    ends = ["", *(f"not applicable: {reason}" if reason else "" for reason in reasons)]
    say_table(lines, numbers=range(len(head), len(lines[0])), ends=ends)


def _line(
    row: dict[str, Any], columns: Sequence[tuple[str, str, int]], *, with_state: bool
) -> list[str]:
    level = "" if row["level"] is None else f"{row['level']:g} {row['unit']}"
    line = [row["estimator"], row["perturbation"] or "(baseline)", level, str(row["seed"])]
    if with_state:
        seconds = row["seconds"]
        word = row["state"]
        line.append(word if seconds is None else f"{word}, {_duration(seconds)}")
    if row["not_applicable"]:
        return line
    metrics = row["metrics"] or {}
    numbers = [(metrics.get(key), digits) for _, key, digits in columns]
    return line + ["-" if value is None else f"{value:.{digits}f}" for value, digits in numbers]


def _duration(seconds: float) -> str:
    if seconds < 60.0:
        return f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"
