"""Logs of a watch that failed for want of something that is not the log's own, for another time."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Collection
from dataclasses import dataclass

#: What lines of failed logs say where the machine or a store lacks something and not the log.
_PASSING = (
    *map(os.strerror, (
        errno.ENOSPC, errno.EDQUOT, errno.ESTALE, errno.EIO, errno.ENOTCONN, errno.ETIMEDOUT,
        errno.EHOSTUNREACH, errno.ENETUNREACH, errno.ECONNREFUSED, errno.ECONNRESET, errno.EMFILE,
    )),
    # of stores.store_error
    "does not answer", "the server answers", "no room to copy it to", "access denied",
    "there are no credentials for it",
)  # fmt: skip
#: The longest time between two trials of such a log, s.
_LONGEST_S = 3600.0


def is_passing(line: str) -> bool:
    """Whether a failed log may well be read another time, by the line that says why it failed."""
    return any(lack in line for lack in _PASSING)


@dataclass(frozen=True)
class _Trial:
    """The last trial of a log: its number, why it failed, and when the next one may be, s."""

    number: int
    why: str
    next_s: float


class PutOff:
    """Logs that are tried again, later each time.

    Args:
        every_s: time until the second trial, s; it doubles from one to the next, up to an hour.
        now_s: a clock that never goes back, s.
        tell: told in a sentence why a log waits, once for each reason.
    """

    def __init__(
        self, every_s: float, now_s: Callable[[], float], tell: Callable[[str], None]
    ) -> None:
        self._every_s, self._now_s, self._tell = every_s, now_s, tell
        self._trials: dict[str, _Trial] = {}

    @property
    def reasons(self) -> dict[str, str]:
        """Why each of them failed, by log."""
        return {log: trial.why for log, trial in self._trials.items()}

    def is_due(self, log: str) -> bool:
        """Whether a log may be tried now; one that was never put off may."""
        trial = self._trials.get(log)
        return trial is None or trial.next_s <= self._now_s()

    def put_off(self, log: str, why: str) -> None:
        """Try a log again, later than the last time."""
        last = self._trials.get(log)
        number = 1 if last is None else last.number + 1
        wait_s = min(self._every_s * 2.0 ** min(number - 1, 30), _LONGEST_S)
        self._trials[log] = _Trial(number, why, self._now_s() + wait_s)
        if last is None or last.why != why:
            self._tell(f"{log}: {why}; trying it again later")

    def forget(self, log: str) -> None:
        """It was kept."""
        self._trials.pop(log, None)

    def keep_only(self, there: Collection[str]) -> None:
        """Forget all other logs: of what came and went in a year nothing is left."""
        self._trials = {log: trial for log, trial in self._trials.items() if log in there}
