"""Trials in, runs out; what was computed before comes from the cache."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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
from slamreplay.replay.round import Progress, Round
from slamreplay.replay.run_cache import cached_run, keep_run
from slamreplay.replay.watch import Watch

__all__ = ["Replayer", "replay", "run_trial"]


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
        watch: told where every trial stands, for whoever looks on.
    """

    def __init__(
        self,
        bundle: Bundle,
        *,
        progress: Progress | None = None,
        cache: Path | None = None,
        workers: int | None = None,
        watch: Watch | None = None,
    ) -> None:
        self.bundle = bundle
        self._progress = progress
        self._cache = None if bundle.path is None else cache
        self._most = workers
        self._watch = watch
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

    def replay(self, trials: Sequence[Trial], *, progress: Progress | None = None) -> list[Run]:
        """A run for each trial, in their order.

        A trial that the log or the estimator does not allow gives a run without an estimate that
        says why.

        Args:
            trials: a round of them.
            progress: of this round, in place of the general one.

        Raises:
            UsageError: a trial is of another bundle, or names what does not exist, or has
                parameters that its estimator does not take.
        """
        for trial in trials:
            if trial.bundle_id != self.bundle.manifest.bundle_id:
                raise UsageError(f"trial {trial.id} is of another bundle", where=trial.bundle_id)
        tell = progress or self._progress
        known = {trial: cached_run(trial, self._cache) for trial in dict.fromkeys(trials)}
        runs = {trial: run for trial, run in known.items() if run is not None}
        round_ = Round(
            list(known), runs, self._forecast, tell, self._watch, self.bundle.path, self._cache
        )
        pending = [trial for trial in known if trial not in runs]
        most = worth_workers(self.bundle, pending) if self._most is None else self._most
        if most < 2 or self.bundle.path is None:
            runs |= dict(self._one_by_one(pending, round_))
        elif pending:
            runs |= dict(self._together(pending, round_, most, self.bundle.path))
        round_.tell({}, 1)
        if tell is not None:
            tell("replayed", 1.0)
        return [runs[trial] for trial in trials]

    def _one_by_one(self, pending: Sequence[Trial], round_: Round) -> Iterator[tuple[Trial, Run]]:
        for trial in pending:
            round_.tell({trial: 0.0}, 1)
            since = monotonic()
            yield trial, self._here(trial)
            round_.end(trial, monotonic() - since)
            round_.tell({}, 1, trial)

    def _together(
        self, pending: Sequence[Trial], round_: Round, most: int, path: Path
    ) -> Iterator[tuple[Trial, Run]]:
        if self._workers is None:
            self._workers = Workers(path, self._cache)
        last = None
        for event in self._workers.run_each(pending, most, self._forecast):
            if isinstance(event, Ended):
                # What no worker did is done here, where its fault shows.
                yield event.trial, event.run or self._here(event.trial)
                round_.end(event.trial, event.seconds)
                last = event.trial
            round_.tell(self._workers.running, most, last)

    def _here(self, trial: Trial) -> Run:
        run = run_trial(self.bundle, trial)
        if self._cache is not None:
            keep_run(run, self._cache)
        return run
