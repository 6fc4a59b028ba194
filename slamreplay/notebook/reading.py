"""Logs in: `sr.ingest`, and what every function takes for one."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from slamreplay.errors import OutputError, UsageError
from slamreplay.notebook.log_bundle import LogBundle
from slamreplay.notebook.progress import Progress, shown

if TYPE_CHECKING:
    from slamreplay.ingest.options import IngestOptions

#: One path, or those of several files of one log.
Paths = str | Path | Iterable[str | Path]


def ingest(
    logs: Paths,
    *,
    map: str | Path | None = None,  # noqa: A002 - as the command line has it
    topics: str | Path | None = None,
    robot: str | None = None,
    reference: str | Path | None = None,
    start: float | None = None,
    end: float | None = None,
    output: str | Path | None = None,
    progress: Progress | bool | None = None,
) -> LogBundle:
    """Read a log into a bundle.

    Args:
        logs: .bag, .mcap, .db3, a rosbag2 folder, CARMEN, MRCLAM; several files are one log. A
            bundle is opened.
        map: map_server yaml that was driven on; wins over a map in the log.
        topics: yaml of `role: topic` that wins over what is chosen.
        robot: namespace or number of the robot to look at.
        reference: poses that judge, as TUM or CSV, or relations.
        start: leave out what is earlier, s from the log's start.
        end: leave out what is later, s from the log's start.
        output: folder of the bundle. By default the user's cache has it: the same log with the same
            options is read once only.
        progress: told how far it is; True draws a line, False nothing.

    Raises:
        SlamreplayError: what is wrong, where, and what can be done about it, in one line.

    >>> import slamreplay as sr
    >>> log = sr.ingest("sample_logs/healthy_short.bag")
    >>> log
    <LogBundle healthy_short.bag: 18.8 s, 12 tables, missing: nothing>
    >>> odometry = log.tables["odometry"]
    >>> odometry[["t_s", "position_x", "linear_velocity_x"]].iloc[-1].round(2).tolist()
    [18.84, 12.14, 0.0]
    >>> odometry.attrs["units"]["linear_velocity_x"]
    'm/s'
    """
    options = options_of(map, topics, robot, reference, start, end)
    return read(paths_of(logs), options, output=output, progress=progress)


def paths_of(logs: Paths) -> list[Path]:
    """As a list.

    Raises:
        UsageError: there is none.
    """
    found = [Path(logs)] if isinstance(logs, str | Path) else [Path(log) for log in logs]
    if not found:
        raise UsageError("there is no log to read", hint="give its path")
    return found


def options_of(
    map_yaml: str | Path | None,
    topics: str | Path | None,
    robot: str | None,
    reference: str | Path | None,
    start_s: float | None,
    end_s: float | None,
) -> IngestOptions:
    """The options as ingest takes them."""
    from slamreplay.ingest.options import IngestOptions

    return IngestOptions(
        map=None if map_yaml is None else Path(map_yaml),
        topics=None if topics is None else Path(topics),
        robot=robot,
        reference=None if reference is None else Path(reference),
        start_s=start_s,
        end_s=end_s,
    )


def read(
    paths: list[Path],
    options: IngestOptions,
    *,
    output: str | Path | None = None,
    progress: Progress | bool | None = None,
) -> LogBundle:
    """A bundle from its folder, or from a raw log.

    Raises:
        UsageError: options or an output, of a bundle that was ingested already.
        SlamreplayError: as of `ingest`.
    """
    from slamreplay.bundle.store import is_bundle
    from slamreplay.bundle.view import Bundle
    from slamreplay.caches import bundle_folder, cache_folder
    from slamreplay.ingest.options import IngestOptions
    from slamreplay.kernel_cache import keep_kernels

    keep_kernels(cache_folder())
    if len(paths) == 1 and is_bundle(paths[0]):
        if options != IngestOptions() or output is not None:
            raise UsageError(
                "a bundle takes no options of a log",
                where=paths[0],
                hint="give the raw log, or leave them out",
            )
        return LogBundle(Bundle.open(paths[0]))
    from slamreplay.ingest.bundle_cache import ingest_once
    from slamreplay.ingest.pipeline import ingest as ingest_log

    with shown(progress) as tell:
        if output is not None:
            return LogBundle(ingest_log(paths, Path(output), options, progress=tell))
        try:
            return LogBundle(ingest_once(paths, bundle_folder(), options, progress=tell))
        except (OSError, OutputError):  # the cache takes nothing
            folder = TemporaryDirectory(prefix="slamreplay-")
            made = ingest_log(paths, Path(folder.name) / "log.bundle", options, progress=tell)
            return LogBundle(made, keeps=folder)
