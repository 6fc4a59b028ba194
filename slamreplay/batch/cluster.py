"""The workers of a batch: processes of this machine, or a cluster of dask that exists."""

from __future__ import annotations

import logging
import re
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from pathlib import Path
from typing import TYPE_CHECKING

from slamreplay.batch.versions import ClusterError, check_versions
from slamreplay.errors import UsageError

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

#: A log may take so long, s: many times what one of a day takes, for it may have to be fetched.
LOG_TIMEOUT_S = 7200.0
_LONGEST_S = 31 * 86_400.0
#: How long a scheduler is looked for, s.
_CONNECT_S = 10.0
#: How often workers of this machine are started.
_STARTS = 3
#: How long is enough for saying goodbye, s.
_CLOSE_S = 10.0
#: Checked by us, for a client of dask that was refused its address cannot even be closed.
_ADDRESS = re.compile(r"((tcp|tls|ws|wss|ucx)://)?([^\s:/\[\]]+|\[[0-9a-fA-F:.]+\]):\d{1,5}/?")

#: For workers of our own. What they hold is small: a log's memory is that of the program, which
#: spilling cannot free and pausing would only stop for ever. `allowed-failures`: who died of what
#: is judged by us, see `loop`. The profiler of dask keeps stacks for a dashboard that is off.
_LOCAL = {
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    "distributed.worker.profile.enabled": False,
    "distributed.scheduler.allowed-failures": 0,
    "distributed.scheduler.worker-ttl": None,
    "distributed.admin.low-level-log-length": 100,
}
#: A map that is sent along is as large as it is.
_CLIENT = {"distributed.admin.large-graph-warning-threshold": "1GiB"}


@dataclass(frozen=True)
class Workers:
    """Who does the work.

    Attributes:
        count: processes on this machine; None is one per core.
        memory_limit: of each of them, bytes or as dask takes it (`4GiB`); None is an even share of
            the machine's.
        scheduler: address of a dask scheduler whose workers do it instead.
        log_timeout_s: a log that takes longer, fetching included, has failed.
    """

    count: int | None = None
    memory_limit: str | None = None
    scheduler: str | None = None
    log_timeout_s: float = LOG_TIMEOUT_S

    def checked(self) -> Workers:
        """The same.

        Raises:
            UsageError: a count, a limit or an address that makes no sense.
        """
        if not 0 < self.log_timeout_s <= _LONGEST_S:
            raise UsageError(
                f"--log-timeout {self.log_timeout_s:g} is no time for a log",
                hint="in s, a month at most",
            )
        if self.count is not None and self.count < 1:
            raise UsageError(f"{self.count} workers do no work", hint="--workers 1 or more")
        if self.scheduler is not None and (self.count is not None or self.memory_limit is not None):
            raise UsageError(
                "--workers and --memory-limit are for workers of this machine",
                hint="those of a --scheduler are started with their own",
            )
        if self.scheduler is not None and _ADDRESS.fullmatch(self.scheduler) is None:
            raise UsageError(
                f"'{self.scheduler}' is no address of a scheduler",
                hint="--scheduler tcp://HOST:8786",
            )
        if self.memory_limit is not None:
            _bytes(self.memory_limit)
        return self


#: Gives a client of the workers for the time of a block, and a scratch folder for those of this
#: machine.
Connect = Callable[[Workers, Path], AbstractContextManager["Client"]]


@contextmanager
def connected(workers: Workers, scratch: Path) -> Iterator[Client]:
    """A client of the workers; those of this machine live as long as the block.

    Args:
        workers: who they are.
        scratch: an empty folder for what workers of this machine write.

    Raises:
        ClusterError: nobody answers at the address, or somebody with other versions.
    """
    import dask
    from distributed import Client

    with _quiet(), ExitStack() as ends:
        ends.enter_context(dask.config.set(_CLIENT))
        if workers.scheduler is None:
            ends.enter_context(dask.config.set(_LOCAL))
            with _interrupts_later():
                cluster = _started(workers, scratch)
                ends.callback(_close, cluster)
            client = Client(cluster, set_as_default=False)
        else:
            client = _reached(workers.scheduler, _CONNECT_S)
        ends.callback(_close, client)
        yield client


@contextmanager
def kept_connected() -> Iterator[Connect]:
    """A way to connect whose workers stay from one block to the next, while this block lasts.

    They are started by the first block that needs them; a client that lost its scheduler is
    replaced.
    """
    with ExitStack() as stack:
        held: list[Client] = []

        @contextmanager
        def connect(workers: Workers, scratch: Path) -> Iterator[Client]:
            if held and held[0].status != "running":
                held.clear()
                stack.close()
            if not held:
                held.append(stack.enter_context(connected(workers, scratch)))
            yield held[0]

        yield connect


def _started(workers: Workers, scratch: Path) -> LocalCluster:
    """Workers of this machine; one that dies while it starts fails them all, so try again."""
    for _ in range(_STARTS - 1):
        with suppress(RuntimeError):
            return _local(workers, scratch)
    try:
        return _local(workers, scratch)
    except RuntimeError as error:
        raise ClusterError(
            f"its workers do not start: {error}",
            hint="do they die for lack of memory? --workers 1, or a larger --memory-limit",
        ) from error


def _local(workers: Workers, scratch: Path) -> LocalCluster:
    from distributed import LocalCluster

    limit = {} if workers.memory_limit is None else {"memory_limit": workers.memory_limit}
    return LocalCluster(
        n_workers=workers.count,
        threads_per_worker=1,
        processes=True,
        dashboard_address=None,
        # Its scheduler listens all the same, and two batches on one machine want one port.
        scheduler_kwargs={"dashboard_address": "localhost:0"},
        silence_logs=logging.CRITICAL + 1,
        local_directory=str(scratch),
        env={"NUMBA_NUM_THREADS": "1"},
        preload=["slamreplay.batch.own_worker"],
        **limit,
    )


@contextmanager
def _interrupts_later() -> Iterator[None]:
    """Ctrl-C takes effect after the block, and never in threads and processes that begin in it.

    A terminal sends it to the workers, too, and to those that are started in their place later.
    """
    if sys.platform == "win32":
        yield
        return
    resource_tracker.ensure_running()  # or else the first process's thread lets signals in again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _reached(address: str, patience_s: float) -> Client:
    from distributed import Client

    try:
        client = Client(address, timeout=patience_s, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ClusterError(
            f"no scheduler answers at {address} within {patience_s:g} s",
            hint="start one with `dask scheduler`, and `dask worker ADDRESS` beside it",
        ) from error
    try:
        check_versions(client, address)
    except BaseException:
        _close(client)
        raise
    return client


def _close(ended: Client | LocalCluster) -> None:
    """Say goodbye; who is gone already hears none."""
    with suppress(Exception):
        ended.close(timeout=_CLOSE_S)


def _bytes(text: str) -> int:
    from dask.utils import parse_bytes

    try:
        size = int(parse_bytes(text))
    except (ValueError, TypeError) as error:
        raise UsageError(f"'{text}' is no size", hint="--memory-limit 4GiB") from error
    if size < 1 << 20:
        raise UsageError(f"{text} is too little for any log", hint="--memory-limit 4GiB")
    return size


@contextmanager
def _quiet() -> Iterator[None]:
    """What dask, tornado and asyncio say to a log is no line of ours."""
    import distributed  # noqa: F401 - it sets its own loggers up when it is imported

    names = ("distributed", "tornado", "asyncio", "bokeh")
    loggers = [
        logging.getLogger(name)
        for name in [*names, *logging.root.manager.loggerDict]
        if name.split(".")[0] in names
    ]
    before = [logger.disabled for logger in loggers]
    for logger in loggers:
        logger.disabled = True
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of other versions it warns; we refuse them
            yield
    finally:
        for logger, was in zip(loggers, before, strict=True):
            logger.disabled = was
