"""What is left to do: which task goes out next, and whom a dead worker died of."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable

from slamreplay.batch.task import LogTask

#: So many tasks of a worker are out at once: one in work, one that waits for it.
PER_WORKER = 2
#: A log fails after so many deaths of workers that had it, the last of them alone with it.
DEATHS = 3


class Work:
    """Tasks that wait, tasks that are out, and tasks that may have killed a worker.

    Attributes:
        deaths: of workers that had a task, by key.
    """

    def __init__(self, tasks: Iterable[LogTask]) -> None:
        self._waiting = deque(tasks)
        self._suspects: deque[LogTask] = deque()
        self._out: dict[str, LogTask] = {}
        self._alone = ""
        self.deaths: Counter[str] = Counter()

    @property
    def left(self) -> bool:
        """Whether a task waits or is out."""
        return bool(self._waiting or self._suspects or self._out)

    def next(self, threads: int) -> LogTask | None:
        """The task to be sent out now; None while enough are out.

        A suspect goes out when nothing else is: then its worker's death is its own doing.

        Args:
            threads: of all workers together, at least 1: a cluster may grow with its tasks.
        """
        if self._waiting and len(self._out) < PER_WORKER * threads:
            task = self._waiting.popleft()
        elif self._suspects and not self._waiting and not self._out:
            task = self._suspects.popleft()
            self._alone = task.key
        else:
            return None
        self._out[task.key] = task
        return task

    def done(self, key: str) -> None:
        """A task that was out has its result."""
        del self._out[key]

    def died(self, key: str, times: int = 1) -> bool:
        """A worker died that had this task, which waits again; True if it is not to be tried."""
        task = self._out.pop(key)
        self.deaths[key] += times
        if self._alone == key and self.deaths[key] >= DEATHS:
            return True
        self._suspects.append(task)
        return False

    def give_back(self) -> None:
        """What is out waits again, before the others, for nobody knows of it any more.

        A suspect that was out was alone: nothing waits beside it, and alone it goes out again.
        """
        self._waiting.extendleft(reversed(self._out.values()))
        self._out.clear()
