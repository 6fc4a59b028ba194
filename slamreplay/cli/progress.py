"""A progress bar on stderr, silent where nobody watches."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

#: What long-running library functions are given: a few words, and the share done from 0 to 1.
Progress = Callable[[str, float], None]


@contextmanager
def progress_bar(title: str) -> Iterator[Progress | None]:
    """A callback that draws a bar with the time left; None where stderr is no terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task(title, total=1.0)

        def show(what: str, share: float) -> None:
            bars.update(task, description=what, completed=share)

        yield show
