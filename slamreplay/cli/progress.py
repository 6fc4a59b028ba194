"""A progress bar on stderr, silent where nobody watches."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta

from slamreplay.cli.terminal import safe

#: From which share done on the time left is told.
_TOLD_FROM = 0.01

#: What long-running library functions are given: a few words, and the share done from 0 to 1.
Progress = Callable[[str, float], None]


@contextmanager
def progress_bar(title: str) -> Iterator[Progress | None]:
    """A callback that draws a bar with the time left; None where stderr is no able terminal."""
    if not sys.stderr.isatty() or os.environ.get("TERM") == "dumb":
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
    from rich.text import Text

    class Left(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(time_left(task.elapsed or 0.0, task.completed), style="progress.remaining")

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), Left())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task(title, total=1.0)

        def show(what: str, share: float) -> None:
            bars.update(task, description=safe(what), completed=share)

        yield show


def time_left(elapsed_s: float, share: float) -> str:
    """Hours, minutes and seconds left where the share done took so long, 0 to 1.

    By the whole time and not by the speed of late, for parallel work comes in at intervals.
    """
    if share < _TOLD_FROM:
        return "-:--:--"
    return f"{timedelta(seconds=round(elapsed_s * (1.0 - share) / share))} left"
