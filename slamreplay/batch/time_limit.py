"""A log that is never done: its worker ends itself, so that others need not wait for it."""

from __future__ import annotations

import faulthandler
from collections.abc import Iterator
from contextlib import contextmanager

from slamreplay.batch import worker
from slamreplay.batch.task import LogResult, LogTask


def look_back_in_time(task: LogTask, limit_s: float, topic: str) -> LogResult:
    """As `worker.look_back`, within a worker of dask; it tells when it begins.

    A worker with several threads has no limit: its end would be that of other logs.

    Args:
        task: the log.
        limit_s: after so long the process of the worker ends; who watches it starts another.
        topic: of the event of dask that tells the task's key.
    """
    from distributed import get_worker

    dask_worker = get_worker()
    dask_worker.log_event(topic, task.key)
    if dask_worker.state.nthreads > 1:
        return worker.look_back(task)
    with _ending_after(limit_s):
        return worker.look_back(task)


@contextmanager
def _ending_after(limit_s: float) -> Iterator[None]:
    """End the process where the block takes longer, and say to stderr what it was at.

    By a thread that is none of Python's, since compiled code may hang with the interpreter's lock.
    """
    faulthandler.dump_traceback_later(limit_s, exit=True)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()
