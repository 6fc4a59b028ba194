"""Trials on several cores: processes, because an estimator is free to hold Python's lock.

Workers are programs of their own that are told trials in lines of JSON and leave runs as files, so
that a notebook or a script without a main guard may replay as well as the command line.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path
from queue import SimpleQueue
from tempfile import TemporaryDirectory

from slamreplay.bundle.run import Run, Trial, read_run
from slamreplay.bundle.view import Bundle

#: A worker has a core to itself: libraries that start threads of their own would fight over it.
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
#: Of a shorter log all trials are done before the workers are there.
LEAST_NS = 60_000_000_000


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


def run_each(
    path: Path, trials: Sequence[Trial], cache: Path | None, workers: int
) -> Iterator[tuple[Trial, Run | None]]:
    """Trials of the bundle at `path` with their runs, as they end; None where a worker failed.

    Args:
        path: of the bundle, which every worker opens once.
        trials: what is to be done; earlier ones begin earlier.
        cache: where runs are kept; without one they are kept until they are read.
        workers: processes.
    """
    with TemporaryDirectory(prefix="slamreplay-") as scratch:
        folder = Path(scratch) if cache is None else cache
        idle: SimpleQueue[subprocess.Popen[str]] = SimpleQueue()
        started = [_start(path, folder) for _ in range(workers)]
        for worker in started:
            idle.put(worker)

        def work(trial: Trial) -> Run | None:
            worker = idle.get()
            try:
                return _ask(worker, trial)
            finally:
                idle.put(worker)

        pool = ThreadPoolExecutor(workers)
        try:
            asked = {pool.submit(work, trial): trial for trial in trials}
            for done in as_completed(asked):
                yield asked[done], done.result()
        finally:
            for worker in started:
                worker.terminate()
            pool.shutdown(wait=True, cancel_futures=True)
            for worker in started:
                worker.communicate()


def _start(path: Path, folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "slamreplay.replay.worker", str(path), str(folder)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        env={**os.environ, **dict.fromkeys(_ONE_THREAD, "1")},
    )  # fmt: skip


def _ask(worker: subprocess.Popen[str], trial: Trial) -> Run | None:
    if worker.stdin is None or worker.stdout is None:
        return None
    try:
        worker.stdin.write(json.dumps(asdict(trial)) + "\n")
        worker.stdin.flush()
        told = worker.stdout.readline().strip()
    except (OSError, ValueError):  # it is dead
        return None
    return read_run(Path(told)) if told else None
