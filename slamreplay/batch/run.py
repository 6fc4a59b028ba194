"""A batch from its tasks to its folder: what is missing is done, what is there is kept."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from slamreplay.batch.cluster import Workers
from slamreplay.batch.commit import Fate, Tell, commit_result, fate_of, fates, silent
from slamreplay.batch.folder import batch_folder
from slamreplay.batch.loop import looked_back
from slamreplay.batch.relabel import relabel
from slamreplay.batch.task import LogTask
from slamreplay.fleet.store import compact

_MB = 1e6


@dataclass(frozen=True)
class BatchEnd:
    """What a batch came to.

    Attributes:
        logs: asked for.
        kept: of them, done by an earlier run.
        states: how many of them have which verdict, by its state.
        gates: how many of them the gate passed, failed or skipped; empty without a gate.
        failed: place and line of those that failed, in the order they were asked for.
        megabytes: of the logs done now.
        seconds: that it took.
        page: of all logs that the folder has.
        fleet: what that page says, in a few lines.
    """

    logs: int
    kept: int
    states: Mapping[str, int]
    gates: Mapping[str, int]
    failed: tuple[tuple[str, str], ...]
    megabytes: float
    seconds: float
    page: Path
    fleet: tuple[str, ...]


def run_batch(
    tasks: Sequence[LogTask],
    target: Path,
    workers: Workers,
    *,
    again_failed: bool = False,
    progress: Callable[[str, float], None] | None = None,
    tell: Tell = silent,
) -> BatchEnd:
    """Look back on every log that is not in the folder yet, and keep each as it is done.

    Whoever is killed at whatever moment, the same call again does what is missing.

    Args:
        tasks: the logs; of two with one key the first counts.
        target: the batch's folder.
        workers: who does it.
        again_failed: try those again that failed before.
        progress: told how many are done, and the share done.
        tell: told in a line what of the folder turned out to be damaged, whose logs are done again,
            and how many logs have other labels now.

    Raises:
        OutputError: the folder is somebody else's, in use, or cannot be written.
        ClusterError: the cluster cannot be used, or went away for good.
    """
    from slamreplay.fleet.answering import answers
    from slamreplay.fleet.page.lines import fleet_lines
    from slamreplay.fleet.page.writer import write_fleet_page

    begun = time.monotonic()
    tasks = list({task.key: task for task in reversed(tasks)}.values())[::-1]
    with batch_folder(target) as scratch:
        before = fates(target, tell)
        told = {
            task.key: before[task.key]
            for task in tasks
            if task.key in before and not (again_failed and before[task.key].error is not None)
        }
        todo = [task for task in tasks if task.key not in told]
        kept = len(told)
        relabelled = relabel(target, [task for task in tasks if task.key in told])
        if relabelled:
            tell(f"{relabelled} logs that were there have other labels now")
        say = _Telling(todo, len(tasks), progress)
        say(told)
        with closing(looked_back(todo, workers, scratch)) as results:
            for result in results:
                commit_result(target, result, tell)
                told[result.key] = fate_of(result)
                say(told, result.key)
        compact(target, tell)
        fleet = answers(target)
        page = write_fleet_page(target, fleet, warn=tell)
    failed = [(task.source.log, told[task.key].error) for task in tasks]
    return BatchEnd(
        logs=len(tasks),
        kept=kept,
        states=_counted(fate.state for fate in told.values()),
        gates=_counted(fate.gate for fate in told.values()),
        failed=tuple((log, line) for log, line in failed if line is not None),
        megabytes=sum(size_of(task) for task in todo) / _MB,
        seconds=time.monotonic() - begun,
        page=page,
        fleet=tuple(fleet_lines(fleet)),
    )


def _counted(words: Iterable[str | None]) -> dict[str, int]:
    return dict(sorted(Counter(word for word in words if word is not None).items()))


def size_of(task: LogTask) -> int:
    """Bytes of its files, as far as they are known."""
    return sum(file.size or 0 for file in task.source.files)


class _Telling:
    """Says how far a batch is: by bytes, for a long log takes longer, or else by logs."""

    def __init__(
        self,
        todo: Sequence[LogTask],
        logs: int,
        progress: Callable[[str, float], None] | None,
    ) -> None:
        sizes = {task.key: size_of(task) for task in todo}
        self._sizes = sizes if all(sizes.values()) else dict.fromkeys(sizes, 1)
        self._all = max(sum(self._sizes.values()), 1)
        self._done = 0
        self._logs = logs
        self._progress = progress

    def __call__(self, told: Mapping[str, Fate], key: str | None = None) -> None:
        self._done += 0 if key is None else self._sizes[key]
        if self._progress is None:
            return
        parts = [f"{len(told)} of {self._logs}"]
        for word, count in (
            ("failed", sum(fate.error is not None for fate in told.values())),
            ("lost", sum("lost" in (fate.state or "") for fate in told.values())),
            ("changed", sum("changed" in (fate.state or "") for fate in told.values())),
            ("gate failed", sum(fate.gate == "failed" for fate in told.values())),
        ):
            parts += [f"{count} {word}"] if count else []
        self._progress(", ".join(parts), self._done / self._all)
