"""Tasks out to the workers, results in as they come, whoever dies on the way."""

from __future__ import annotations

import time
import uuid
from collections.abc import Generator, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING

from slamreplay.batch.cluster import Connect, Workers, connected
from slamreplay.batch.stopping import check_stopped
from slamreplay.batch.task import LogResult, LogTask
from slamreplay.batch.time_limit import look_back_in_time
from slamreplay.batch.versions import ClusterError
from slamreplay.batch.work import Work
from slamreplay.batch.worker import failed, line_of

if TYPE_CHECKING:
    from distributed import Client, Future

    _Ended = tuple[Future, LogResult | Exception]

#: How often is looked whether the cluster still lives, s.
_LOOK_S = 1.0
#: How long a scheduler that went away is looked for, and how long workers may be missing, s.
RECONNECT_S, WITHOUT_WORKERS_S = 120.0, 600.0
#: News of a beginning may take longer than that of an end.
_NEARLY = 0.9
_KEPT = "what is done is kept: run the same command again"


class _LostError(Exception):
    """The scheduler went away."""


def looked_back(
    tasks: Sequence[LogTask], workers: Workers, scratch: Path, connect: Connect = connected
) -> Generator[LogResult]:
    """The result of every task, once each, in the order they are done.

    A worker that dies may have died of the log it worked on, or of another's. All logs that it had
    are tried again at the end with nothing beside them: who kills workers even then fails. A
    scheduler that goes away is looked for, and what it had is given to it anew.

    Args:
        tasks: what to do; few of them are out at any time, so nothing piles up anywhere.
        workers: who does it.
        scratch: folder for what workers of this machine write.
        connect: reaches them; by default workers of this machine end with the tasks.

    Raises:
        ClusterError: the cluster cannot be used, or went away for good.
    """
    work = Work(tasks)
    lost: float | None = None
    while work.left:
        try:
            with connect(workers, scratch) as client:
                for result in served(client, work, workers):
                    lost = None
                    yield result
        except _LostError:
            lost = time.monotonic() if lost is None else lost
            work.give_back()
        except ClusterError:
            if lost is None:
                raise
        if lost is not None:
            if time.monotonic() - lost > RECONNECT_S:
                raise ClusterError("the scheduler went away", where=workers.scheduler, hint=_KEPT)
            check_stopped()
            time.sleep(_LOOK_S)


def served(client: Client, work: Work, workers: Workers) -> Iterator[LogResult]:
    """Results until nothing is left.

    Raises:
        _LostError: the scheduler went away; what is out is still marked so.
        ClusterError: no worker came for a long time.
    """
    out: dict[Future, LogTask] = {}
    ended: SimpleQueue[_Ended] = SimpleQueue()
    begun: dict[str, float] = {}
    topic = f"slamreplay-{uuid.uuid4().hex}"
    seen = looked = time.monotonic()
    threads = _threads(client)
    try:
        client.subscribe_topic(topic, lambda event: begun.update({event[1]: time.monotonic()}))
        while work.left:
            while (task := work.next(max(threads, 1))) is not None:
                future = _sent(client, task, workers, topic)
                out[future] = task
                client.loop.add_callback(_fetch, client, future, ended)
            check_stopped()
            try:
                end = ended.get(timeout=_LOOK_S)
            except Empty:
                end = None
            now = time.monotonic()
            if end is None or now - looked > _LOOK_S:
                threads, looked = _threads(client), now
                seen = now if threads else seen
                if now - seen > WITHOUT_WORKERS_S:
                    raise ClusterError(
                        f"no worker for {WITHOUT_WORKERS_S:g} s",
                        where=workers.scheduler,
                        hint=_KEPT,
                    )
                if any(sent.cancelled() for sent in out):
                    raise _LostError
            if end is not None:
                future, came = end
                task = out.pop(future)
                took_s = now - begun.pop(task.key, now)
                result = _outcome(came, task, work, workers, took_s)
                future.release()
                if result is not None:
                    yield result
    finally:
        for future in out:  # a client that stays must not have done what nobody waits for
            with suppress(Exception):
                future.release()
        with suppress(Exception):
            client.unsubscribe_topic(topic)


async def _fetch(client: Client, future: Future, ended: SimpleQueue[_Ended]) -> None:
    """Put what a task ends with into the queue: no dead worker may hold up the results of others.

    One that dies before its result was fetched is asked for it for half a minute; then dask has
    the task done again.
    """
    from distributed import CancelledError

    try:
        (result,) = await client.gather([future], asynchronous=True)
        ended.put((future, result))
    except (CancelledError, OSError, TimeoutError) as error:
        # Of a task that failed it is its own error, and says nothing about the scheduler.
        ended.put((future, error if future.status == "error" else _LostError()))
    except Exception as error:
        ended.put((future, error))


def _sent(client: Client, task: LogTask, workers: Workers, topic: str) -> Future:
    # The same task may go out several times, and dask takes one key for one result.
    key = f"look_back-{task.key}-{uuid.uuid4().hex[:8]}"
    try:
        return client.submit(
            look_back_in_time, task, workers.log_timeout_s, topic, key=key, pure=False
        )
    except OSError as error:
        raise _LostError from error


def _threads(client: Client) -> int:
    """Tasks that all workers together can work on at once."""
    try:
        if client.status == "running":
            return sum(client.nthreads().values())
    except (OSError, TimeoutError, ValueError) as error:
        raise _LostError from error
    raise _LostError


def _outcome(
    came: LogResult | Exception, task: LogTask, work: Work, workers: Workers, took_s: float
) -> LogResult | None:
    """The result of a task that ended after so long; None if it goes out again."""
    from distributed import KilledWorker

    if isinstance(came, LogResult):
        work.done(task.key)
        return _with_attempts(came, work.deaths[task.key] + 1)
    if isinstance(came, _LostError):
        raise came
    limit_s = workers.log_timeout_s
    if isinstance(came, KilledWorker) and took_s >= _NEARLY * limit_s:
        work.done(task.key)  # its worker ended itself, as it would every time
        return failed(task, f"not done after {limit_s:g} s (hint: see --log-timeout)")
    deaths = came.allowed_failures + 1 if isinstance(came, KilledWorker) else 1
    if not work.died(task.key, deaths):
        return None
    if isinstance(came, KilledWorker):
        line = f"its worker died {work.deaths[task.key]} times (hint: {_memory_hint(workers)})"
    else:  # `look_back` raises nothing: it was not even begun
        line = line_of(came)
    return failed(task, line)


def _memory_hint(workers: Workers) -> str:
    if workers.scheduler is not None:
        return "it may need more memory than its workers have; their own log tells"
    limit = "its share of the machine's" if workers.memory_limit is None else workers.memory_limit
    return f"it may need more memory than {limit}, see --memory-limit"


def _with_attempts(result: LogResult, begun: int) -> LogResult:
    """The result with how often it was begun, as far as known: the worker does not know."""
    import pyarrow as pa

    costs = result.tables.get("costs")
    if costs is None:
        return result
    at = costs.schema.get_field_index("attempts")
    column = pa.array([begun] * len(costs), costs.schema.field(at).type)
    costs = costs.set_column(at, costs.schema.field(at), column)
    return replace(result, tables={**result.tables, "costs": costs})
