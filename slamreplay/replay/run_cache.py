"""Runs that were computed before, each in a file named by all that it depends on."""

from __future__ import annotations

import hashlib
import inspect
import json
from functools import cache as once
from pathlib import Path
from typing import Any

import numpy as np

import slamreplay
from slamreplay.bundle.atomic import write_file
from slamreplay.bundle.run import Run, Trial, read_run, run_bytes
from slamreplay.errors import BundleError, OutputError
from slamreplay.estimators import ESTIMATORS
from slamreplay.perturb import PERTURBATIONS
from slamreplay.replay.parameters import configured

#: Packages whose code an estimate depends on.
_CODE = ("geometry", "maps", "matching", "graph", "bundle", "perturb", "estimators", "replay")


def run_file(trial: Trial, cache: Path) -> Path:
    """Where a cache keeps the run of a trial."""
    return cache / f"{_key(trial)}.npz"


def cached_run(trial: Trial, cache: Path | None) -> Run | None:
    """The run of a trial, or None where it is not there or damaged."""
    if cache is None or not run_file(trial, cache).is_file():
        return None
    try:
        return read_run(run_file(trial, cache))
    except BundleError:
        return None  # damaged, or of an older version: computed again and replaced


def keep_run(run: Run, cache: Path) -> bool:
    """Whether a run could be kept: a cache that cannot be written costs time, nothing else.

    Its file is whole or absent, whenever this process is killed.
    """
    try:
        cache.mkdir(parents=True, exist_ok=True)
        write_file(run_file(run.trial, cache), run_bytes(run))
    except (OSError, OutputError):
        return False
    return True


def _key(trial: Trial) -> str:
    """Hash of everything a run depends on: evidence, trial, configuration, code, numpy."""
    estimator = ESTIMATORS.load(trial.estimator)
    configuration = repr(configured(trial.estimator, trial.parameters))
    parts = [json.dumps(trial.record), configuration, _code(), np.__version__]
    parts.append(_source(estimator))
    if trial.perturbation is not None:
        perturbation = PERTURBATIONS.load(trial.perturbation.partition(".")[0])
        parts += [repr(perturbation()), _source(perturbation)]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


@once
def _code() -> str:
    root = Path(slamreplay.__file__).parent
    digest = hashlib.sha256()
    for file in sorted(f for name in _CODE for f in (root / name).rglob("*.py")):
        digest.update(file.relative_to(root).as_posix().encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def _source(thing: Any) -> str:
    """The file a plug-in comes from: ours are hashed with the package already."""
    try:
        return Path(inspect.getfile(thing)).read_text(encoding="utf-8")
    except (OSError, TypeError):
        return repr(thing)
