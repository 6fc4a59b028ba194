"""What is asked of an export: the same for every format."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.run import Run
from slamreplay.bundle.view import Bundle
from slamreplay.errors import UsageError
from slamreplay.evidence.result import Postmortem
from slamreplay.geometry.times import Times, ns


@dataclass(frozen=True)
class Window:
    """From when to when is written: ns on the bundle's clock, both ends belong to it."""

    start_ns: int
    end_ns: int

    def holds(self, t_ns: Times) -> NDArray[np.bool_]:
        """(N,) which times lie in it."""
        return np.asarray((t_ns >= self.start_ns) & (t_ns <= self.end_ns))


@dataclass(frozen=True, eq=False)
class Request:
    """One export.

    Attributes:
        bundle: the log; its names are replaced already where that was asked for.
        runs: trials on it; empty where a log or a bundle was given.
        window: what is written of it; None is all.
        post: what was found in it; None where only recorded evidence is asked for.
        report_json: the report of it, for formats that take files along.
        recorded: whether recorded evidence is written, beside what was found.
        covariance: whether trajectories are written with their covariances, too.
        redacted: whether names were replaced.
        progress: told a few words and the share done, 0 to 1; None where nobody watches.
    """

    bundle: Bundle
    runs: Sequence[Run] = ()
    window: Window | None = None
    post: Postmortem | None = None
    report_json: str | None = None
    recorded: bool = True
    covariance: bool = False
    redacted: bool = False
    progress: Callable[[str, float], None] | None = None

    def holds(self, t_ns: Times) -> NDArray[np.bool_]:
        """(N,) which times are to be written."""
        return np.ones(len(t_ns), dtype=bool) if self.window is None else self.window.holds(t_ns)

    @property
    def span(self) -> Window:
        """The window, or the whole log."""
        manifest = self.bundle.manifest
        return self.window or Window(manifest.start_ns, manifest.end_ns)

    def say(self, what: str, share: float) -> None:
        """Tell how far the work is."""
        if self.progress is not None:
            self.progress(what, share)


def window_of(bundle: Bundle, start_s: float | None, end_s: float | None) -> Window | None:
    """The part between two times in seconds after the log's start; None where none was named.

    Raises:
        UsageError: nothing lies between them.
    """
    if start_s is None and end_s is None:
        return None
    first, last = bundle.manifest.start_ns, bundle.manifest.end_ns
    start = max(first, first + ns(start_s or 0.0))
    end = last if end_s is None else min(last, first + ns(end_s))
    if not start < end:
        length_s = (last - first) / 1e9
        raise UsageError(
            f"nothing is left between --start {start_s or 0:g} and "
            f"--end {length_s if end_s is None else end_s:g}",
            hint=f"the log lasts {length_s:.1f} s",
        )
    return Window(start, end)
