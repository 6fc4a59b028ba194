"""How long trials take, learned while they run: which go first, and how much time is left."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from statistics import median

from slamreplay.bundle.run import Trial

#: A trial that runs for longer than expected is nearly done: it does not count for more than this.
_NEARLY = 0.95


class Forecast:
    """Seconds that the trials of one log take, by estimator.

    What is perturbed hardly matters for it; which estimator runs makes a hundredfold difference.

    Args:
        before: seconds that trials of the same log or as long a one took earlier, by estimator.
    """

    def __init__(self, before: Mapping[str, float] | None = None) -> None:
        self._before = dict(before or {})
        self._seen: dict[str, list[float]] = {}

    def learn(self, trial: Trial, seconds: float) -> None:
        """Take in that a trial took so long."""
        self._seen.setdefault(trial.estimator, []).append(seconds)

    @property
    def known(self) -> dict[str, float]:
        """Seconds by estimator, of those that were ever seen."""
        return self._before | {name: median(times) for name, times in self._seen.items()}

    def seconds(self, trial: Trial) -> float:
        """What a trial is expected to take; as long as the others where its estimator never ran."""
        known = self.known
        if trial.estimator in known:
            return known[trial.estimator]
        return sum(known.values()) / len(known) if known else 1.0

    def longest_first(self, trials: Iterable[Trial]) -> list[Trial]:
        """Trials in the order in which to begin them: then all cores end at about the same time.

        Of estimators that were never seen one trial each goes first. (Longest processing time
        first ends at most a third later than the best order: Graham, SIAM J. Appl. Math. 17, 1969.)
        """
        order = {trial: place for place, trial in enumerate(trials)}
        first: dict[str, Trial] = {}
        for trial in order:
            if trial.estimator not in self.known:
                first.setdefault(trial.estimator, trial)
        unseen = set(first.values())
        return sorted(order, key=lambda t: (t not in unseen, -self.seconds(t), order[t]))

    def left_s(
        self, waiting: Sequence[Trial], running: Mapping[Trial, float], cores: int
    ) -> float | None:
        """Seconds until all is done; None before the first trial ended.

        Args:
            waiting: not yet begun.
            running: since how many seconds each runs.
            cores: trials that run at once.
        """
        if not self.known:
            return None
        rest = [max(self.seconds(t) - since, 0.0) for t, since in running.items()]
        todo = [self.seconds(trial) for trial in waiting]
        return max(max(rest + todo, default=0.0), (sum(rest) + sum(todo)) / max(cores, 1))

    def share(
        self, done: Sequence[Trial], waiting: Sequence[Trial], running: Mapping[Trial, float]
    ) -> float:
        """Share of the work that is done, 0 to 1.

        Of `running`, as in `left_s`, the part that is expected to be; nothing of trials whose
        estimator never ran.
        """
        known = self.known
        over = sum(self.seconds(trial) for trial in done)
        part = sum(
            min(since, _NEARLY * self.seconds(trial))
            for trial, since in running.items()
            if trial.estimator in known
        )
        total = over + sum(self.seconds(trial) for trial in (*waiting, *running))
        return (over + part) / total if total > 0.0 else 1.0
