"""Trials that were replayed and measured, each once, whoever asks."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from slamreplay.bundle.kept import kept
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.run import Run, Trial, run_bytes
from slamreplay.bundle.view import Bundle
from slamreplay.consistency.evidence.source import Reference
from slamreplay.doses.judge import BASELINE, Judges
from slamreplay.doses.measure import Measured, measured
from slamreplay.doses.plan import Dose
from slamreplay.replay.run_cache import run_key
from slamreplay.replay.runner import Replayer

Progress = Callable[[str, float], None]


class Trials:
    """What is known so far of a log's trials.

    Runs are measured and let go, but for baselines and those of the first seed: hundreds of them
    would not fit into memory.

    Args:
        bundle: the log.
        parameters: canonical JSON by estimator, for those that do not run with their defaults.
        first_seed: whose runs are kept.
        judges: of the log.
        replayer: of the log; it does every round.
        numbers: folder in which numbers are kept from one design to the next.
    """

    def __init__(
        self,
        bundle: Bundle,
        parameters: Mapping[str, str],
        first_seed: int,
        judges: Judges,
        replayer: Replayer,
        numbers: Path | None = None,
    ) -> None:
        self._bundle, self._parameters = bundle, parameters
        self._first_seed, self._judges = first_seed, judges
        # A bundle in memory has no hash of its own.
        self._replayer, self._folder = replayer, None if bundle.path is None else numbers
        self._view = bundle.view()
        self._odometry = odometry_track(self._view)
        self._judge_of: dict[str, Reference | None] = {}
        self._numbers: dict[Trial, Measured] = {}
        self._reasons: dict[Trial, str] = {}
        self._digests: dict[Trial, str] = {}
        self._runs: dict[Trial, Run] = {}

    def baseline(self, estimator: str, seed: int) -> Trial:
        """The undisturbed trial."""
        parameters = self._parameters.get(estimator, "")
        return Trial(self._bundle.manifest.bundle_id, estimator, seed, parameters=parameters)

    def dosed(self, estimator: str, seed: int, dose: Dose) -> Trial:
        """The same with one level of one perturbation, which may be its baseline."""
        return replace(self.baseline(estimator, seed), perturbation=dose.perturbation,
                       level=dose.level, unit=dose.unit)  # fmt: skip

    def ask(self, trials: Iterable[Trial], progress: Progress | None = None) -> None:
        """Replay and measure those that are not known.

        A trial is held against the baseline of its seed, which is known or among them; where it is
        neither, all baselines are the same and the first seed's stands for it.

        Args:
            trials: of this log.
            progress: told what is being done, and the share done.
        """
        fresh = [trial for trial in dict.fromkeys(trials) if trial not in self._numbers]
        fresh.sort(key=lambda trial: trial.perturbation is not None)
        if fresh:
            for run in self._replayer.replay(fresh, progress=progress):
                self._take(run)

    def _take(self, run: Run) -> None:
        trial = run.trial
        undisturbed = self.baseline(trial.estimator, trial.seed)
        if trial == undisturbed or trial.seed == self._first_seed:
            self._runs[trial] = run
        if trial.perturbation is None or trial.seed == self._first_seed:
            self._digests[trial] = _digest(run)
        if run.estimate is None:
            self._reasons[trial] = run.not_applicable or "no estimate"
        if trial.estimator not in self._judge_of and run.estimate is not None:
            self._judge_of[trial.estimator] = self._judges.of(run.estimate.track)
        known = self._runs.get(undisturbed)
        baseline = known or self._runs[self.baseline(trial.estimator, self._first_seed)]
        judge = self._judge_of.get(trial.estimator)
        self._numbers[trial] = self._measured(run, baseline, judge)

    def _measured(self, run: Run, baseline: Run, judge: Reference | None) -> Measured:
        def make() -> bytes:
            found = measured(run, baseline, judge, self._bundle, self._view, self._odometry)
            return json.dumps(found).encode()

        folder = None if run.estimate is None else self._folder
        told = ["numbers of a dose", run_key(run.trial), run_key(baseline.trial), _judge(judge)]
        return dict(json.loads(kept(folder, told, make)))

    @property
    def known(self) -> int:
        """How many there are."""
        return len(self._numbers)

    def numbers(self, trial: Trial) -> Measured | None:
        """What was measured; None of a trial that nobody asked for."""
        return self._numbers.get(trial)

    def reason(self, trial: Trial) -> str:
        """Why a trial was not applicable; empty where it was."""
        return self._reasons.get(trial, "")

    def has_pose(self, trial: Trial) -> bool:
        """Whether a run that was kept has any pose."""
        estimate = self._runs[trial].estimate
        return estimate is not None and bool(estimate.track.has_pose.any())

    def same_bits(self, one: Trial, other: Trial) -> bool:
        """Whether two runs, of baselines or of the first seed, are the same but for the trial."""
        return self._digests[one] == self._digests[other]

    def judged_by(self, estimator: str) -> str:
        """What errors of an estimator are measured against."""
        judge = self._judge_of.get(estimator)
        return BASELINE if judge is None else judge.kind

    def run(self, trial: Trial) -> Run:
        """A run that was kept."""
        return self._runs[trial]


def _judge(judge: Reference | None) -> str:
    """A judge as a hash of all that it says."""
    if judge is None:
        return BASELINE
    track = judge.track
    names = [judge.kind, judge.source, track.frame_id, track.child_frame_id]
    digest = hashlib.sha256("\0".join(names).encode())
    for array in (track.t_ns, track.xyyaw, track.cov):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _digest(run: Run) -> str:
    bare = replace(run, trial=Trial("", run.trial.estimator, 0))
    return hashlib.sha256(run_bytes(bare)).hexdigest()
