"""How far the work is: a line on stderr where somebody watches."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

#: Told a few words, and the share done from 0 to 1.
Progress = Callable[[str, float], None]

_WIDTH = 24


@contextmanager
def shown(progress: Progress | bool | None) -> Iterator[Progress | None]:
    """What a long-running function is given to tell how far it is.

    Args:
        progress: a function that is told itself; True draws a line on stderr, False nothing; None
            draws it where stderr is a terminal or a notebook, so that scripts are silent.
    """
    if callable(progress):
        yield progress
        return
    if progress is False or (progress is None and not _is_watched()):
        yield None
        return
    longest = 0

    def draw(what: str, share: float) -> None:
        nonlocal longest
        done = round(_WIDTH * min(max(share, 0.0), 1.0))
        line = f"{'#' * done}{'.' * (_WIDTH - done)} {100.0 * share:3.0f} % {what}"
        longest = max(longest, len(line))
        sys.stderr.write(f"\r{line:<{longest}}")
        sys.stderr.flush()

    try:
        yield draw
    finally:
        if longest:
            sys.stderr.write(f"\r{'':<{longest}}\r")
            sys.stderr.flush()


def _is_watched() -> bool:
    return sys.stderr.isatty() or _in_notebook()


def _in_notebook() -> bool:
    """Whether a Jupyter kernel runs this; asked without importing it."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return shell is not None and getattr(shell, "kernel", None) is not None
