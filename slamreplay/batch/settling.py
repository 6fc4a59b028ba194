"""Which logs of a folder are whole: nobody writes to them any more, and nothing of them lacks."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from slamreplay.batch.addresses import is_local
from slamreplay.batch.complete import Completeness
from slamreplay.batch.task import LogSource

#: What changes when a log is written to: address, version, size and time of change of each file.
Marks = tuple[tuple[str, str, int | None, int], ...]

#: A log whose format does not say where it ends has to stand still so many times as long.
_UNSURE = 6


@dataclass(frozen=True)
class Patience:
    """How long a log must have stood still, s.

    Attributes:
        settle_s: one that says itself that it is whole.
        give_up_s: one that says it is not: a robot's battery died, and nobody will ever close it.
    """

    settle_s: float = 10.0
    give_up_s: float = 3600.0

    def needed_s(self, said: Completeness) -> float:
        """For a log that says this of itself."""
        needed = {"yes": self.settle_s, "unknown": _UNSURE * self.settle_s, "no": self.give_up_s}
        return max(needed[said.state], self.settle_s)


@dataclass(frozen=True)
class Looked:
    """What one look at a folder came to.

    Attributes:
        ready: logs that stood still long enough, the latest written first, until they are taken.
        lacking: those that stand still and are not whole, with what they lack.
        moving: how many were written to so lately that nothing can be said of them.
    """

    ready: tuple[LogSource, ...]
    lacking: Mapping[str, str]
    moving: int


@dataclass
class _Seen:
    """A log as the last look saw it; `said` is None until it was asked."""

    marks: Marks
    since_s: float
    said: Completeness | None = None
    is_taken: bool = False


class Settling:
    """What is known of the logs of a folder from one look to the next.

    A log stands still while its marks stay the same by this machine's own clock: no clock of a file
    server can put that wrong, and every log has to for `settle_s`. What is needed beyond that of
    logs that do not say that they are whole may be told by the times of their files, so that a
    watch that is started anew need not wait for so long again.

    Args:
        patience: how long logs must stand still.
        completeness: what a log says of itself.
        now_s: a clock that never goes back, s.
        wall_s: the clock that files are dated by, s since 1970.
    """

    def __init__(
        self,
        patience: Patience,
        completeness: Callable[[LogSource], Completeness],
        *,
        now_s: Callable[[], float] = time.monotonic,
        wall_s: Callable[[], float] = time.time,
    ) -> None:
        self.settle_s, self.now_s = patience.settle_s, now_s
        self._patience, self._completeness, self._wall_s = patience, completeness, wall_s
        self._seen: dict[str, _Seen] = {}

    def look(self, sources: Iterable[LogSource]) -> Looked:
        """Take in what lies there now; what is not there any more is forgotten."""
        before, self._seen = self._seen, {}
        ready: list[tuple[int, LogSource]] = []
        lacking: dict[str, str] = {}
        moving = 0
        for source in sources:
            now, marks = self.now_s(), marks_of(source)
            seen = before.get(_place(source))
            if seen is None or seen.marks != marks:
                seen = _Seen(marks, now)
            self._seen[_place(source)] = seen
            if seen.is_taken:
                continue
            still_s = now - seen.since_s
            if still_s < self.settle_s:
                moving += 1
                continue
            if seen.said is None or seen.said.state == "no":  # what lies beside it may have gone
                seen.said = self._completeness(source)
            changed_ns = _changed_ns(marks)
            if seen.said.state != "yes" and changed_ns:
                still_s = max(still_s, self._wall_s() - changed_ns / 1e9)
            if still_s >= self._patience.needed_s(seen.said):
                ready.append((changed_ns, source))
            elif seen.said.state == "no":
                lacking[source.log] = seen.said.reason
            else:
                moving += 1
        # What happened last is what people wait for; of two at one time the first by name.
        ready.sort(key=lambda one: -one[0])
        return Looked(tuple(source for _, source in ready), lacking, moving)

    def take(self, source: LogSource) -> None:
        """Say no more of this log unless it is written to again."""
        self._seen[_place(source)].is_taken = True

    def still_is(self, source: LogSource) -> bool:
        """Whether a log is what the last look saw."""
        seen = self._seen.get(_place(source))
        return seen is not None and seen.marks == marks_of(source)


def is_there(source: LogSource) -> bool:
    """Whether all files of a log can still be found; elsewhere that is taken for granted."""
    return all(size is not None for _, _, size, _ in marks_of(source))


def marks_of(source: LogSource) -> Marks:
    """What changes when a log is written to; of files elsewhere as they were listed."""
    marks = []
    for file in source.files:
        size, changed_ns = file.size, 0
        if is_local(file.url):
            try:
                about = Path(file.url).stat()
                size, changed_ns = about.st_size, about.st_mtime_ns
            except OSError:  # it is gone
                size = None
        marks.append((file.url, file.version, size, changed_ns))
    return tuple(marks)


def _changed_ns(marks: Marks) -> int:
    """When the latest of the files was written; 0 where that is not known."""
    return max((changed_ns for *_, changed_ns in marks), default=0)


def _place(source: LogSource) -> str:
    return source.files[0].url
