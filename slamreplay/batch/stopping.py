"""Ctrl-C and SIGTERM end a batch, whatever Python was doing when they came."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

#: What was asked for and not yet obeyed.
_asked: list[int] = []


class Stopped(KeyboardInterrupt):
    """Somebody wants it to end.

    Attributes:
        number: of the signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number

    @property
    def is_terminated(self) -> bool:
        """By SIGTERM, as services and containers are."""
        return self.number == signal.SIGTERM


@contextmanager
def stoppable() -> Iterator[None]:
    """Within it both signals raise `Stopped`, here and again at the next `check_stopped`.

    What is raised while Python calls back from a finalizer or a weak reference is printed and
    forgotten, and a client of dask has many of these: a signal that comes just then would be lost.
    Once told is enough: what comes later does not disturb the tidying up.
    """

    def stop(number: int, _frame: FrameType | None) -> None:
        if not _asked:
            _asked.append(number)
            raise Stopped(number)

    _asked.clear()
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, stop) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)
        _asked.clear()


def check_stopped() -> None:
    """Called where long work goes round.

    Raises:
        Stopped: somebody wants it to end, and that was not heeded yet.
    """
    if _asked:
        raise Stopped(_asked[0])
