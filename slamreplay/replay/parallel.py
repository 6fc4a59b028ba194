"""Trials on several cores: processes, because an estimator is free to hold Python's lock.

Workers are programs of their own that are told trials in lines of JSON and leave runs as files, so
that a notebook or a script without a main guard may replay as well as the command line. They end
with whoever started them, however that ends: their standard input is closed then.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from tempfile import TemporaryDirectory
from threading import Thread
from time import monotonic

from slamreplay.bundle.run import Run, Trial, read_run
from slamreplay.bundle.view import Bundle
from slamreplay.errors import BundleError
from slamreplay.replay.forecast import Forecast

#: A worker has a core to itself: libraries that start threads of their own would fight over it.
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
#: Of a shorter log all trials are done before the workers are there.
LEAST_NS = 60_000_000_000
#: A trial whose worker was killed so often is given up: it may be what takes all the memory.
MOST_KILLED = 2
#: How often those who wait are told that time passes, s.
TICK_S = 1.0


def worth_workers(bundle: Bundle, pending: Sequence[Trial]) -> int:
    """How many processes to share trials out to; 1 means none."""
    too_short = bundle.manifest.end_ns - bundle.manifest.start_ns < LEAST_NS
    if bundle.path is None or too_short:
        return 1
    return min(len(pending), available_cores())


def available_cores() -> int:
    """Cores this process may run on."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


@dataclass(frozen=True)
class Ended:
    """A trial that a worker is done with; the run is None where the worker failed at it."""

    trial: Trial
    run: Run | None


@dataclass(eq=False)
class _Worker:
    process: subprocess.Popen[str]
    ears: Thread | None = None
    trial: Trial | None = None
    since: float = 0.0


class Workers:
    """Processes that do trials of one bundle, kept until they are closed.

    Args:
        bundle: path, which every worker opens once.
        cache: where runs are kept; without one they are kept until they are read.
    """

    def __init__(self, bundle: Path, cache: Path | None) -> None:
        self._bundle, self._cache = bundle, cache
        self._scratch = TemporaryDirectory(prefix="slamreplay-")
        self._workers: list[_Worker] = []
        self._told: SimpleQueue[tuple[_Worker, str | None]] = SimpleQueue()

    @property
    def running(self) -> dict[Trial, float]:
        """Trials that are being done, and since how many seconds."""
        now = monotonic()
        return {w.trial: now - w.since for w in self._workers if w.trial is not None}

    @property
    def pids(self) -> list[int]:
        """Process numbers of the workers."""
        return [worker.process.pid for worker in self._workers]

    def run_each(
        self, trials: Sequence[Trial], most: int, forecast: Forecast
    ) -> Iterator[Ended | None]:
        """Trials as they end, and None whenever a moment passed or one was begun.

        A worker that is killed, as by a system that ran out of memory, is replaced and its trial
        begun once more, after the others; killed again, it is a run that says so. What a worker
        fails at by itself is left to the caller, where its fault shows.

        Args:
            trials: what is to be done, each once.
            most: workers to use.
            forecast: says which to begin next, and learns.
        """
        waiting, killed = list(trials), dict.fromkeys(trials, 0)
        again: list[Trial] = []
        try:
            while waiting or again or self.running:
                while (waiting or again) and len(self.running) < most:
                    source = waiting or again
                    trial = forecast.longest_first(source)[0] if waiting else again[0]
                    source.remove(trial)
                    self._begin(trial)
                    yield None
                try:
                    worker, line = self._told.get(timeout=TICK_S)
                except Empty:
                    yield None
                    continue
                mine, worker.trial = worker.trial, None
                if line is None:
                    code = self._forget(worker)
                    if mine is None:
                        continue
                    if code >= 0:  # it failed, and whoever asked shall see why
                        yield Ended(mine, None)
                        continue
                    killed[mine] += 1
                    if killed[mine] < MOST_KILLED:
                        again.append(mine)
                        yield None
                    else:
                        yield Ended(mine, Run(mine, None, _killed_words(-code)))
                elif mine is not None:
                    forecast.learn(mine, monotonic() - worker.since)
                    yield Ended(mine, _run_from(line.strip()))
        finally:  # whoever stops listening does not want the rest
            for worker in [w for w in self._workers if w.trial is not None]:
                worker.process.kill()
                self._forget(worker)

    def close(self) -> None:
        """End all workers."""
        for worker in self._workers:
            worker.process.terminate()
        for worker in list(self._workers):
            self._forget(worker)
        self._scratch.cleanup()

    def _begin(self, trial: Trial) -> None:
        worker = next((w for w in self._workers if w.trial is None), None)
        if worker is None:
            worker = self._start()
        worker.trial, worker.since = trial, monotonic()
        assert worker.process.stdin is not None
        with suppress(OSError):  # it is dead, and whoever listens to it will say so
            worker.process.stdin.write(json.dumps(asdict(trial)) + "\n")
            worker.process.stdin.flush()

    def _start(self) -> _Worker:
        folders = [str(folder) for folder in (self._cache, self._scratch.name) if folder]
        process = subprocess.Popen(
            [sys.executable, "-m", "slamreplay.replay.worker", str(self._bundle), *folders],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            env={**os.environ, **dict.fromkeys(_ONE_THREAD, "1")},
        )  # fmt: skip
        worker = _Worker(process)
        self._workers.append(worker)
        worker.ears = Thread(target=self._listen, args=(worker,), daemon=True)
        worker.ears.start()
        return worker

    def _listen(self, worker: _Worker) -> None:
        assert worker.process.stdout is not None
        with worker.process.stdout as lines:
            for line in lines:
                self._told.put((worker, line))
        self._told.put((worker, None))

    def _forget(self, worker: _Worker) -> int:
        """The code a worker that ends ended with; below 0 it was killed by that signal."""
        if worker in self._workers:
            self._workers.remove(worker)
        worker.trial = None
        code = worker.process.wait()
        if worker.ears is not None:
            worker.ears.join()
        if worker.process.stdin is not None:
            with suppress(OSError):  # what it was told last may never have reached it
                worker.process.stdin.close()
        return code


def _run_from(path: str) -> Run | None:
    if not path:
        return None
    try:
        return read_run(Path(path))
    except BundleError:
        return None  # somebody took it away: it is done once more


def _killed_words(signal: int) -> str:
    return (
        f"its process was killed {MOST_KILLED} times (signal {signal}), as systems do that run out "
        "of memory"
    )
