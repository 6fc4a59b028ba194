"""Runs that were computed before, each in a file named by all that it depends on."""

from __future__ import annotations

import hashlib
import inspect
import json
from pathlib import Path
from typing import Any

import numpy as np

from slamreplay.bundle.atomic import write_file
from slamreplay.bundle.code_hash import code_hash
from slamreplay.bundle.run import Run, Trial, read_run, run_bytes
from slamreplay.errors import BundleError, OutputError
from slamreplay.estimators import ESTIMATORS
from slamreplay.perturb import PERTURBATIONS
from slamreplay.replay.parameters import configured

#: Packages whose code an estimate depends on.
_CODE = ("geometry", "maps", "matching", "graph", "bundle", "perturb", "estimators", "replay")


def run_file(trial: Trial, cache: Path) -> Path:
    """Where a cache keeps the run of a trial."""
    return cache / f"{run_key(trial)}.npz"


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


def run_key(trial: Trial) -> str:
    """Hash of everything a run depends on: evidence, trial, configuration, code, numpy.

    What comes with the package is not loaded for it: its defaults are part of its code.
    """
    parts = [json.dumps(trial.record), _code(), np.__version__]
    if not _is_ours(ESTIMATORS.target(trial.estimator)):
        parts.append(repr(configured(trial.estimator, trial.parameters)))
        parts.append(_source(ESTIMATORS.load(trial.estimator)))
    if trial.perturbation is not None:
        name = trial.perturbation.partition(".")[0]
        if not _is_ours(PERTURBATIONS.target(name)):
            perturbation = PERTURBATIONS.load(name)
            parts += [repr(perturbation()), _source(perturbation)]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def _is_ours(target: str) -> bool:
    return target.startswith(tuple(f"slamreplay.{package}." for package in _CODE))


def _code() -> str:
    return code_hash(*_CODE)


def _source(thing: Any) -> str:
    """The file that a plug-in comes from."""
    try:
        return Path(inspect.getfile(thing)).read_text(encoding="utf-8")
    except (OSError, TypeError):
        return repr(thing)
