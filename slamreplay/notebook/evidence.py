"""What every function takes as evidence: a value of this package, or the path of something."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from slamreplay.errors import UsageError
from slamreplay.notebook.log_bundle import LogBundle
from slamreplay.notebook.progress import Progress
from slamreplay.notebook.reading import Paths, options_of, paths_of, read
from slamreplay.notebook.runs_value import Runs

if TYPE_CHECKING:
    from slamreplay.bundle.run import Run
    from slamreplay.replay.dose import DoseResults

#: A log, its runs, or the path of a log, a bundle or a folder of runs.
Evidence = LogBundle | Runs | Paths


@dataclass(frozen=True, eq=False)
class Found:
    """A log, and the runs on it where there are some."""

    log: LogBundle
    runs: tuple[Run, ...] = ()
    design: DoseResults | None = None


def found(evidence: Evidence, options: dict[str, Any], progress: Progress | bool | None) -> Found:
    """What lies behind an argument.

    Args:
        evidence: see `Evidence`.
        options: of a log that has yet to be read, by the names that `sr.ingest` has for them.
        progress: as of `sr.ingest`.

    Raises:
        UsageError: options, of something that was ingested already.
        SlamreplayError: as of `sr.ingest`.
    """
    given = [name for name, value in options.items() if value is not None]
    if isinstance(evidence, LogBundle | Runs):
        _refuse(given, evidence)
        if isinstance(evidence, Runs):
            return Found(evidence.log, tuple(evidence.runs), evidence.design)
        return Found(evidence)
    from slamreplay.notebook.opening import opened_runs
    from slamreplay.replay.folder import is_runs

    paths = paths_of(evidence)
    if len(paths) == 1 and is_runs(paths[0]):
        _refuse(given, paths[0])
        return found(opened_runs(paths[0]), {}, progress)
    names = ("map", "topics", "robot", "reference", "start", "end")
    told = options_of(*(options.get(name) for name in names))
    return Found(read(paths, told, progress=progress))


def _refuse(given: list[str], where: object) -> None:
    if given:
        raise UsageError(
            f"{', '.join(given)}: only a log that has yet to be read takes this",
            where=where,
            hint="give the raw log, or leave it out",
        )
