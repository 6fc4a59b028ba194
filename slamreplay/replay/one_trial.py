"""One trial: the evidence, changed as the trial says, given to its estimator."""

from __future__ import annotations

from typing import Any

import numpy as np

from slamreplay.bundle.run import Run, Trial
from slamreplay.bundle.view import Bundle, BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.perturb import PERTURBATIONS
from slamreplay.replay.parameters import configured
from slamreplay.replay.reported import REPORTED, as_reported

#: Random numbers of the perturbation do not depend on how many the estimator draws.
_PERTURBATION_STREAM = 1


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
        return Run(trial, as_reported(estimator.run(view, seed=trial.seed), view.settings))
    except NotApplicableError as reason:
        return Run(trial, None, str(reason))
    except np.linalg.LinAlgError as fault:
        # Evidence in the wrong unit by 1e20: what broke is the filter, and the other trials go on.
        return Run(trial, None, f"{estimator.name}: its arithmetic broke down ({fault})")


def _refuse_recorded(trial: Trial, estimator: Any) -> None:
    """What was recorded stays as it was, whatever is done to the evidence."""
    if trial.perturbation is None or getattr(estimator, "reruns", True):
        return
    if not PERTURBATIONS.load(trial.perturbation.partition(".")[0]).touches <= REPORTED:
        raise NotApplicableError("recorded, cannot be run again")


def _refuse_ignored(view: BundleView, estimator: Any) -> None:
    """A setting that is not honoured would pass the baseline off as a trial."""
    ignored = sorted(set(view.settings) - estimator.settings - REPORTED)
    if ignored:
        raise NotApplicableError(f"has no setting {', '.join(ignored)}", where=estimator.name)
