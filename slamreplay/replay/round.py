"""One round of trials, as it is told to those who wait for it or look on."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from slamreplay.bundle.run import Trial
from slamreplay.replay.forecast import Forecast
from slamreplay.replay.run_cache import run_file
from slamreplay.replay.watch import TrialState, Watch

#: Told what is being done, and the share of the work that is done.
Progress = Callable[[str, float], None]


class Round:
    """Which trials are done, and who is told.

    Args:
        trials: of the round, each once.
        there: those that came from the cache.
        forecast: of how long they take.
        progress: told of the others.
        watch: told of all.
        bundle: folder of the evidence, where it is on disk.
        cache: where runs are kept.
    """

    def __init__(
        self,
        trials: Sequence[Trial],
        there: Iterable[Trial],
        forecast: Forecast,
        progress: Progress | None,
        watch: Watch | None,
        bundle: Path | None,
        cache: Path | None,
    ) -> None:
        self._there, self._done = set(there), dict[Trial, float | None]()
        self._pending = [trial for trial in trials if trial not in self._there]
        self._forecast, self._progress, self._share = forecast, progress, 0.0
        self._watch, self._bundle = (watch if bundle is not None else None), bundle
        self._files: dict[Trial, Path | None] = {}
        if self._watch is not None:
            self._files = {t: run_file(t, cache) if cache else None for t in trials}

    def end(self, trial: Trial, seconds: float | None) -> None:
        """Take in that a trial ended; without a time where it was no run as others are."""
        self._done[trial] = seconds
        if seconds is not None:
            self._forecast.learn(trial, seconds)

    def tell(self, running: Mapping[Trial, float], cores: int, last: Trial | None = None) -> None:
        """Tell how it stands.

        Args:
            running: trials that are being done, and since how many seconds.
            cores: trials that run at once.
            last: the one that was done last.
        """
        now = next(iter(running), last)
        waiting = [t for t in self._pending if t not in self._done and t not in running]
        if self._progress is not None and now is not None:
            done = self._forecast.share(list(self._done), waiting, running)
            self._share = max(self._share, done)
            self._progress(words_of(now), self._share)
        if self._watch is None or self._bundle is None:
            return
        if self._watch.is_due or not (waiting or running):
            states = [self._state(trial, running) for trial in self._files]
            left_s = self._forecast.left_s(waiting, running, cores)
            self._watch.tell(self._bundle, states, left_s)

    def _state(self, trial: Trial, running: Mapping[Trial, float]) -> TrialState:
        if trial in self._there or trial in self._done:
            return TrialState(trial, "done", self._done.get(trial), self._files[trial])
        if trial in running:
            return TrialState(trial, "running", running[trial], self._files[trial])
        return TrialState(trial, "waiting", None, self._files[trial])


def words_of(trial: Trial) -> str:
    """A trial as a person would name it."""
    if trial.perturbation is None:
        return f"{trial.estimator}, baseline"
    return f"{trial.estimator}, {trial.perturbation} {trial.level:g} {trial.unit}"
