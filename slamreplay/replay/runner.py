"""Trials in, runs out; what was computed before comes from the cache."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import Self

from slamreplay.bundle.run import Run, Trial
from slamreplay.bundle.view import Bundle
from slamreplay.errors import UsageError
from slamreplay.replay.forecast import Forecast
from slamreplay.replay.one_trial import run_trial
from slamreplay.replay.parallel import Ended, Workers, worth_workers
from slamreplay.replay.run_cache import cached_run, keep_run

__all__ = ["Replayer", "replay", "run_trial"]

#: Told what is being done, and the share of the work that is done.
Progress = Callable[[str, float], None]


def replay(
    bundle: Bundle,
    trials: Sequence[Trial],
    *,
    progress: Progress | None = None,
    cache: Path | None = None,
    workers: int | None = None,
) -> list[Run]:
    """A run for each trial, in their order; of one round of trials, else as of `Replayer`."""
    with Replayer(bundle, progress=progress, cache=cache, workers=workers) as replayer:
        return replayer.replay(trials)


class Replayer:
    """Does trials of one bundle, round after round, with the same workers.

    Use it as a context: `with Replayer(bundle, cache=folder) as replayer: replayer.replay(trials)`.

    Args:
        bundle: the evidence.
        progress: told what is being done, and the share done of the round, weighed by how long
            trials take; what comes from the cache is no part of it.
        cache: folder of earlier runs; one that cannot be written is not used. Every run is there as
            soon as it is done: after a kill the same trials go on from where they were.
        workers: processes that share the trials, one per core by default; a short log and a bundle
            that is not on disk are done in this one. Runs are the same bit by bit.
    """

    def __init__(
        self,
        bundle: Bundle,
        *,
        progress: Progress | None = None,
        cache: Path | None = None,
        workers: int | None = None,
    ) -> None:
        self.bundle = bundle
        self._tell: Progress = progress or (lambda words, share: None)  # noqa: ARG005 - nobody
        self._cache = None if bundle.path is None else cache
        self._most = workers
        self._forecast = Forecast()
        self._workers: Workers | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the workers; the next round would start others."""
        if self._workers is not None:
            self._workers.close()
            self._workers = None

    def replay(self, trials: Sequence[Trial]) -> list[Run]:
        """A run for each trial, in their order.

        A trial that the log or the estimator does not allow gives a run without an estimate that
        says why.

        Raises:
            UsageError: a trial is of another bundle, or names what does not exist, or has
                parameters that its estimator does not take.
        """
        for trial in trials:
            if trial.bundle_id != self.bundle.manifest.bundle_id:
                raise UsageError(f"trial {trial.id} is of another bundle", where=trial.bundle_id)
        known = {trial: cached_run(trial, self._cache) for trial in dict.fromkeys(trials)}
        runs = {trial: run for trial, run in known.items() if run is not None}
        pending = [trial for trial in known if trial not in runs]
        runs |= dict(self._computed(pending))
        self._tell("replayed", 1.0)
        return [runs[trial] for trial in trials]

    def _computed(self, pending: Sequence[Trial]) -> Iterator[tuple[Trial, Run]]:
        most = worth_workers(self.bundle, pending) if self._most is None else self._most
        done: list[Trial] = []
        if most < 2 or self.bundle.path is None:
            for place, trial in enumerate(pending):
                waiting = pending[place:]
                self._tell(_words(trial), self._forecast.share(done, waiting, {}))
                since = monotonic()
                yield trial, self._here(trial)
                self._forecast.learn(trial, monotonic() - since)
                done.append(trial)
                self._tell(_words(trial), self._forecast.share(done, waiting[1:], {}))
            return
        if self._workers is None:
            self._workers = Workers(self.bundle.path, self._cache)
        share = 0.0
        for event in self._workers.run_each(pending, most, self._forecast):
            if isinstance(event, Ended):
                # What no worker did is done here, where its fault shows.
                yield event.trial, event.run or self._here(event.trial)
                done.append(event.trial)
            running = self._workers.running
            waiting = [t for t in pending if t not in done and t not in running]
            share = max(share, self._forecast.share(done, waiting, running))
            self._tell(_words(next(iter(running), pending[-1])), share)

    def _here(self, trial: Trial) -> Run:
        run = run_trial(self.bundle, trial)
        if self._cache is not None:
            keep_run(run, self._cache)
        return run


def _words(trial: Trial) -> str:
    if trial.perturbation is None:
        return f"{trial.estimator}, baseline"
    return f"{trial.estimator}, {trial.perturbation} {trial.level:g} {trial.unit}"
