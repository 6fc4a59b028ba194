"""Trials in, runs out; what was computed before comes from the cache."""

from __future__ import annotations

import hashlib
import inspect
import json
from collections.abc import Callable, Iterable, Sequence
from functools import cache as once
from pathlib import Path
from typing import Any

import numpy as np

import slamreplay
from slamreplay.bundle.atomic import write_file
from slamreplay.bundle.run import Run, Trial, read_run, run_bytes
from slamreplay.bundle.view import Bundle, BundleView
from slamreplay.errors import BundleError, NotApplicableError, OutputError, UsageError
from slamreplay.estimators import ESTIMATORS
from slamreplay.perturb import PERTURBATIONS
from slamreplay.replay.parallel import run_each, worth_workers
from slamreplay.replay.parameters import configured

#: Random numbers of the perturbation do not depend on how many the estimator draws.
_PERTURBATION_STREAM = 1
#: Packages whose code an estimate depends on.
_CODE = ("geometry", "maps", "matching", "graph", "bundle", "perturb", "estimators", "replay")


def replay(
    bundle: Bundle,
    trials: Sequence[Trial],
    *,
    progress: Callable[[str, float], None] | None = None,
    cache: Path | None = None,
    workers: int | None = None,
) -> list[Run]:
    """A run for each trial, in their order.

    A trial that the log or the estimator does not allow gives a run without an estimate that says
    why.

    Args:
        bundle: the evidence.
        trials: of this bundle.
        progress: told what is being done, and the share done.
        cache: folder of earlier runs; one that cannot be written is not used.
        workers: processes that share the trials, one per core by default; a short log and a bundle
            that is not on disk are done in this one. Runs are the same bit by bit.

    Raises:
        UsageError: a trial is of another bundle, or names what does not exist, or has parameters
            that its estimator does not take.
    """
    for trial in trials:
        if trial.bundle_id != bundle.manifest.bundle_id:
            raise UsageError(f"trial {trial.id} is of another bundle", where=trial.bundle_id)
    cache = None if bundle.path is None else cache
    known = {trial: _from_cache(trial, cache) for trial in trials}
    runs = {trial: run for trial, run in known.items() if run is not None}
    pending = [trial for trial in dict.fromkeys(trials) if trial not in runs]
    workers = worth_workers(bundle, pending) if workers is None else workers
    found: Iterable[tuple[Trial, Run | None]] = ((trial, None) for trial in pending)
    if workers > 1 and bundle.path is not None:
        found = run_each(bundle.path, pending, cache, workers)
    tell = progress or (lambda words, share: None)  # noqa: ARG005 - nobody listens
    if pending:
        tell(_words(pending[0]), len(runs) / len(trials))
    for trial, run in found:  # what no worker did is done here, where its fault shows
        runs[trial] = into_cache(bundle, trial, cache) if run is None else run
        tell(_words(trial), len(runs) / len(trials))
    tell("replayed", 1.0)
    return [runs[trial] for trial in trials]


def run_trial(bundle: Bundle, trial: Trial) -> Run:
    """One run, computed afresh."""
    estimator = configured(trial.estimator, trial.parameters)
    view = bundle.view()
    try:
        _refuse_recorded(trial, estimator)
        if trial.perturbation is not None and trial.level is not None:
            name, _, variant = trial.perturbation.partition(".")
            stream = np.random.SeedSequence([trial.seed, _PERTURBATION_STREAM])
            rng = np.random.Generator(np.random.PCG64(stream))
            view = PERTURBATIONS.load(name)().apply(view, variant, trial.level, rng)
        _refuse_ignored(view, estimator)
        return Run(trial, estimator.run(view, seed=trial.seed))
    except NotApplicableError as reason:
        return Run(trial, None, str(reason))


def _refuse_recorded(trial: Trial, estimator: Any) -> None:
    """What was recorded stays as it was, whatever is done to the evidence."""
    if trial.perturbation is not None and not getattr(estimator, "reruns", True):
        raise NotApplicableError("recorded, cannot be run again")


def _refuse_ignored(view: BundleView, estimator: Any) -> None:
    """A setting that is not honoured would pass the baseline off as a trial."""
    ignored = sorted(set(view.settings) - estimator.settings)
    if ignored:
        raise NotApplicableError(f"has no setting {', '.join(ignored)}", where=estimator.name)


def run_file(trial: Trial, cache: Path) -> Path:
    """Where a cache keeps the run of a trial."""
    return cache / f"{_key(trial)}.npz"


def _from_cache(trial: Trial, cache: Path | None) -> Run | None:
    if cache is None or not run_file(trial, cache).is_file():
        return None
    try:
        return read_run(run_file(trial, cache))
    except BundleError:
        return None  # damaged, or of an older version: computed again and replaced


def into_cache(bundle: Bundle, trial: Trial, cache: Path | None) -> Run:
    """One run, computed afresh and kept in a folder, where that can be written."""
    run = run_trial(bundle, trial)
    if cache is not None:
        try:
            cache.mkdir(parents=True, exist_ok=True)
            write_file(run_file(trial, cache), run_bytes(run))
        except (OSError, OutputError):
            pass  # a cache that cannot be written costs time, nothing else
    return run


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


def _words(trial: Trial) -> str:
    if trial.perturbation is None:
        return f"{trial.estimator}, baseline"
    return f"{trial.estimator}, {trial.perturbation} {trial.level:g} {trial.unit}"
