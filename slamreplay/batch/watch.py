"""A folder that is watched: logs are looked back on as they become whole, round after round.

It looks at intervals and depends on no notices of a file system, which a share or an object store
does not send. Nothing is kept in memory alone: what is done stands in the batch's folder, so that a
watch that was killed goes on, as a batch does, with what is missing.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from slamreplay.batch.cluster import Workers, kept_connected
from slamreplay.batch.commit import commit_result, fates
from slamreplay.batch.finished import Finished, finished_of
from slamreplay.batch.folder import batch_folder
from slamreplay.batch.loop import looked_back
from slamreplay.batch.put_off import PutOff, is_passing
from slamreplay.batch.relabel import relabel
from slamreplay.batch.settling import Looked, Settling, is_there
from slamreplay.batch.stopping import check_stopped
from slamreplay.batch.task import LogResult, LogSource, LogTask
from slamreplay.batch.worker import line_of
from slamreplay.errors import OutputError, SlamreplayError

#: The results of tasks, as `loop.looked_back` gives them.
LookBack = Callable[[Sequence[LogTask]], Generator[LogResult]]


@dataclass(frozen=True)
class Pace:
    """How a folder is watched.

    Attributes:
        every_s: time between two looks, and between trials where a folder cannot be written, s.
        per_round: so many logs are done before the next look: the latest come first, so that what
            happens now need not wait for all that happened before.
        is_once: one look, all that is whole, and the end; a fault ends it then.
    """

    every_s: float = 30.0
    per_round: int = 32
    is_once: bool = False


@dataclass
class Tally:
    """What a watch came to so far; it outlives a watch that is stopped.

    Attributes:
        finished: logs that were kept.
        failed: of them, those that could not be judged.
        gate_failed: of them, those whose gate failed.
        lacking: logs that are not whole or cannot be tried now, with what they lack.
        moving: logs that are still written to.
        relabelled: logs that were there and have other labels now.
    """

    finished: int = 0
    failed: int = 0
    gate_failed: int = 0
    lacking: dict[str, str] = field(default_factory=dict)
    moving: int = 0
    relabelled: int = 0


def watch(
    target: Path,
    find: Callable[[], Sequence[LogSource]],
    settling: Settling,
    task_of: Callable[[LogSource], LogTask],
    serve: Callable[[Path], AbstractContextManager[LookBack]],
    *,
    pace: Pace,
    tell: Callable[[str], None],
    finished: Callable[[Finished], None],
    finish_round: Callable[[], None] = lambda: None,
    tally: Tally | None = None,
    sleep: Callable[[float], None] = time.sleep,
) -> Tally:
    """Look back on what becomes whole, until somebody stops it.

    Args:
        target: the batch's folder.
        find: lists the logs there are.
        settling: tells which of them are whole.
        task_of: the task of a log.
        serve: given a scratch folder, who looks back on tasks while the block lasts.
        pace: how.
        tell: told in a sentence what hinders, each thing once for as long as it does.
        finished: told of each log that is kept.
        finish_round: what is made anew after rounds in which something was kept: the page.
        tally: is filled; a new one by default.
        sleep: waits, s.

    Raises:
        SlamreplayError: the logs cannot be listed or the folder not be written, at the first look,
            and with `is_once` whenever it is.
    """
    tally = Tally() if tally is None else tally
    with batch_folder(target) as scratch, serve(scratch) as look_back:
        rounds = _Rounds(
            target, settling, task_of, look_back, pace, tell, finished, tally, sleep,
            PutOff(pace.every_s, settling.now_s, tell), done=set(fates(target, tell)),
        )  # fmt: skip
        is_first = True
        while True:
            looked = rounds.looked(find, is_first=is_first)
            if looked is not None and pace.is_once and is_first and looked.moving:
                sleep(settling.settle_s)
                looked = rounds.looked(find, is_first=True)
            before = tally.finished, tally.relabelled
            has_more = looked is not None and rounds.play(looked, is_first=is_first)
            if (tally.finished, tally.relabelled) != before:
                rounds.finish(finish_round)
            if pace.is_once and not has_more:
                return tally
            is_first = False
            check_stopped()
            if not has_more:
                sleep(pace.every_s)


@dataclass
class _Rounds:
    """What lasts from one round to the next."""

    target: Path
    settling: Settling
    task_of: Callable[[LogSource], LogTask]
    look_back: LookBack
    pace: Pace
    tell: Callable[[str], None]
    finished: Callable[[Finished], None]
    tally: Tally
    sleep: Callable[[float], None]
    put_off: PutOff
    done: set[str]
    told: dict[str, str] = field(default_factory=dict)

    def looked(self, find: Callable[[], Sequence[LogSource]], *, is_first: bool) -> Looked | None:
        """What is whole now; None while nothing can be listed."""
        try:
            sources = find()
        except SlamreplayError as error:
            if is_first or self.pace.is_once:
                raise
            self._tell("list", f"{error}; waiting for it")
            return None
        self._tell("list", "")
        looked = self.settling.look(sources)
        self.tally.lacking, self.tally.moving = dict(looked.lacking), looked.moving
        for log, reason in looked.lacking.items():
            self._tell(f"lacks {log}", f"{log}: not whole: {reason}; waiting for the rest")
        for what in [
            w for w in self.told if w.startswith("lacks ") and w[6:] not in looked.lacking
        ]:
            del self.told[what]
        self.put_off.keep_only({source.log for source in sources})
        self.tally.lacking |= self.put_off.reasons
        return looked

    def play(self, looked: Looked, *, is_first: bool) -> bool:
        """One round; whether logs are left for the next one, without waiting."""
        todo: dict[str, tuple[LogTask, LogSource]] = {}
        known: list[LogTask] = []
        for source in looked.ready:
            if len(todo) == self.pace.per_round:
                break
            if not self.put_off.is_due(source.log):
                continue
            try:
                task = self.task_of(source)
            except SlamreplayError as error:  # its map, say
                self._put_off(source, str(error))
                continue
            if task.key in self.done:
                self.settling.take(source)
                self._forget(source.log)
                known.append(task)
            else:
                todo.setdefault(task.key, (task, source))
        if known:
            self.written(lambda: self._relabel(known))
        try:
            with closing(self.look_back([task for task, _ in todo.values()])) as results:
                for result in results:
                    self._keep(result, todo[result.key][1])
        except SlamreplayError as error:
            if is_first or self.pace.is_once:
                raise
            self._tell("work", f"{error}; trying again every {self.pace.every_s:g} s")
            return False
        self._tell("work", "")
        return len(todo) == self.pace.per_round

    def written(self, write: Callable[[], None]) -> None:
        """Write, again and again while the place takes nothing."""
        while True:
            try:
                write()
            except OutputError as error:
                if self.pace.is_once:
                    raise
                self._tell("write", f"{error}; trying again every {self.pace.every_s:g} s")
                self.sleep(self.pace.every_s)
            else:
                self._tell("write", "")
                return

    def _relabel(self, known: Sequence[LogTask]) -> None:
        self.tally.relabelled += relabel(self.target, known)

    def finish(self, make: Callable[[], None]) -> None:
        """Make anew what is made after a round; a fault in it must not end a watch over night."""
        try:
            self.written(make)
        except OutputError:
            raise
        except Exception as error:
            if self.pace.is_once:
                raise
            self._tell("page", f"the page is as it was: {line_of(error)}")
        else:
            self._tell("page", "")

    def _keep(self, result: LogResult, source: LogSource) -> None:
        is_other = not self.settling.still_is(source)
        if is_other and (is_there(source) or result.error is not None):
            # What was read may be half of the old log and half of the new one.
            self.tell(f"{source.log}: changed while it was read, so it waits again")
            return
        if result.error is not None and is_passing(result.error):
            self._put_off(source, result.error)
            return
        self.written(lambda: commit_result(self.target, result, self.tell))
        self.done.add(result.key)
        self._forget(source.log)
        if not is_other:
            self.settling.take(source)
        one = finished_of(self.target, result)
        self.tally.finished += 1
        self.tally.failed += one.has_failed
        self.tally.gate_failed += one.gate == "failed"
        self.finished(one)

    def _put_off(self, source: LogSource, why: str) -> None:
        self.put_off.put_off(source.log, why)
        self.tally.lacking[source.log] = why

    def _forget(self, log: str) -> None:
        """That it was put off."""
        self.put_off.forget(log)
        self.tally.lacking.pop(log, None)

    def _tell(self, what: str, line: str) -> None:
        """Tell what hinders once, and that it no longer does; an empty line: it does not."""
        if not line and what in self.told:
            del self.told[what]
            self.tell("that is over: going on")
        elif line and self.told.get(what) != line:
            self.told[what] = line
            self.tell(line)


@contextmanager
def served(workers: Workers, scratch: Path) -> Iterator[LookBack]:
    """Workers that stay from round to round; one that is asked nothing is not even started.

    Raises:
        ClusterError: nobody answers at the scheduler's address.
    """
    with kept_connected() as connect:
        if workers.scheduler is not None:
            with connect(workers, scratch):
                pass  # a wrong address is told now, not when the first log comes
        yield lambda tasks: looked_back(tasks, workers, scratch, connect)
