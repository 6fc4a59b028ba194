"""A RUNS folder: `runs.json`, `runs/*.npz`, and maybe the bundle the runs are of."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from slamreplay.bundle.atomic import atomic_folder
from slamreplay.bundle.run import Run, Trial, read_run, run_bytes
from slamreplay.bundle.view import Bundle
from slamreplay.errors import BundleError, OutputError

RUNS = "runs.json"
RUNS_FORMAT = 1


def write_runs(
    target: Path,
    bundle: Bundle,
    runs: Sequence[Run],
    *,
    keep_bundle: bool = False,
    beside: Mapping[str, bytes] = MappingProxyType({}),
) -> None:
    """Write runs so that the folder is whole or absent.

    Args:
        target: the folder; an earlier one of ours is replaced.
        bundle: what the runs are of, on disk.
        runs: in the order of their trials.
        keep_bundle: copy the bundle to `target/bundle`, for one that would else be gone; without
            it `runs.json` holds the relative path to it.
        beside: further files by name.

    Raises:
        OutputError: somebody else's folder, one that cannot be written, or a bundle that was
            never written to disk.
    """
    if bundle.path is None:
        raise OutputError("the bundle of these runs is not on disk", where=target)
    source = bundle.path.resolve()
    keep_bundle = keep_bundle or source == target.resolve() / "bundle"
    relative = "bundle" if keep_bundle else Path(os.path.relpath(source, target.resolve()))
    head = {
        "runs_format": RUNS_FORMAT,
        "bundle_id": bundle.manifest.bundle_id,
        "bundle": Path(relative).as_posix(),
        "trials": [
            {**run.trial.record, "run": f"runs/{run.trial.id}.npz", "reason": run.not_applicable}
            for run in runs
        ],
    }
    with atomic_folder(target, marker=RUNS) as work:
        (work / "runs").mkdir()
        for run in runs:
            (work / "runs" / f"{run.trial.id}.npz").write_bytes(run_bytes(run))
        if keep_bundle:
            shutil.copytree(source, work / "bundle")
        for name, content in beside.items():
            (work / name).write_bytes(content)
        text = json.dumps(head, indent=1, allow_nan=False)
        (work / RUNS).write_text(text + "\n", encoding="utf-8")


def is_runs(path: Path) -> bool:
    """Whether `path` is a RUNS folder."""
    try:
        return (path / RUNS).is_file()
    except OSError:  # a name that no folder can have
        return False


def read_runs(path: Path) -> tuple[Bundle, list[Run]]:
    """The bundle and the runs of a RUNS folder.

    Raises:
        BundleError: no such folder, another format, a run that is missing or not the one it is
            said to be, or a bundle that is gone or another one.
    """
    try:
        head = json.loads((path / RUNS).read_text(encoding="utf-8"))
        if head["runs_format"] != RUNS_FORMAT:
            raise BundleError(
                f"runs format {head['runs_format']}, this program reads {RUNS_FORMAT}", where=path
            )
        listed = [dict(entry) for entry in head["trials"]]
        files = [path / str(entry.pop("run")) for entry in listed]
        for entry in listed:
            entry.pop("reason")
        trials = [Trial(**entry) for entry in listed]
        beneath, bundle_id = path / str(head["bundle"]), head["bundle_id"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BundleError(
            "not a folder of runs", where=path, hint="make one with perturb"
        ) from error
    runs = [read_run(file) for file in files]
    for trial, run, file in zip(trials, runs, files, strict=True):
        if run.trial != trial:
            raise BundleError("run is of another trial", where=file, hint="run perturb again")
    bundle = Bundle.open(beneath)
    if bundle.manifest.bundle_id != bundle_id:
        raise BundleError(
            "these runs are of another bundle", where=beneath, hint="run perturb again"
        )
    return bundle, runs
