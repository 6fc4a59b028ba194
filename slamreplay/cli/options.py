"""Arguments and options that several commands share, and what they mean together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from slamreplay.errors import UsageError

if TYPE_CHECKING:
    from slamreplay.bundle.view import Bundle
    from slamreplay.ingest.options import IngestOptions

Logs = Annotated[
    list[Path],
    typer.Argument(
        metavar="LOG...",
        help="ROS 1 .bag, rosbag2 folder, .mcap or .db3 (several are one log); or one CARMEN .clf "
        "(.gz, .bz2), MRCLAM folder or bundle.",
    ),
]
MapYaml = Annotated[
    Path | None,
    typer.Option("--map", metavar="YAML", help="The map that was driven on, of map_server."),
]
Topics = Annotated[
    Path | None,
    typer.Option("--topics", metavar="YAML", help="Which topic plays which role, as ROLE: TOPIC."),
]
Robot = Annotated[
    str | None,
    typer.Option("--robot", metavar="NS", help="Robot to look at: its namespace or number."),
]
Reference = Annotated[
    Path | None,
    typer.Option(
        "--reference",
        metavar="FILE",
        help="Reference poses as TUM or CSV, or .relations: they judge.",
    ),
]
Start = Annotated[
    float | None,
    typer.Option("--start", metavar="S", help="Leave out what is earlier, in s from the start."),
]
End = Annotated[
    float | None,
    typer.Option("--end", metavar="S", help="Leave out what is later, in s from the start."),
]
Cause = Annotated[
    bool,
    typer.Option(
        "--cause/--no-cause",
        help="Replay what went wrong with one thing put right at a time, to name its root cause.",
    ),
]
#: Seeds from here on leave no room for those of several trials in 64 bits.
SEED_END = 2**62

Seed = Annotated[int, typer.Option("--seed", help="Seed of every random number.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON on stdout.")]


def checked_seed(seed: int) -> int:
    """The same seed.

    Raises:
        UsageError: no generator takes it.
    """
    if not 0 <= seed < SEED_END:
        raise UsageError(f"seed {seed} is {'negative' if seed < 0 else 'too large'}")
    return seed


def ingest_options(
    *,
    map_yaml: Path | None,
    topics: Path | None,
    robot: str | None,
    reference: Path | None,
    start_s: float | None,
    end_s: float | None,
) -> IngestOptions:
    """The options of a command line as ingest takes them."""
    from slamreplay.ingest.options import IngestOptions

    return IngestOptions(
        map=map_yaml, topics=topics, robot=robot, reference=reference, start_s=start_s, end_s=end_s
    )


@contextmanager
def evidence(
    logs: Sequence[Path],
    options: IngestOptions,
    *,
    keep: Path | None = None,
    cache: Path | None = None,
) -> Iterator[Bundle]:
    """The bundle behind a command's LOG argument; a raw log is ingested on the way.

    Args:
        logs: a bundle, or the files of one log.
        options: how to ingest; a bundle was ingested already and takes none.
        keep: where the bundle of a raw log is written; by default it lives as long as the block.
        cache: folder of bundles, where that of a raw log is looked for and kept instead; one that
            cannot be written is not used.

    Raises:
        UsageError: options that only a raw log can take, given with a bundle.
    """
    from slamreplay.bundle.store import is_bundle
    from slamreplay.bundle.view import Bundle
    from slamreplay.cli.progress import progress_bar
    from slamreplay.ingest.options import IngestOptions

    if len(logs) == 1 and is_bundle(logs[0]):
        if options != IngestOptions():
            raise UsageError(
                "a bundle takes no --map, --topics, --robot, --reference, --start or --end",
                where=logs[0],
                hint="give the raw log, or ingest it again with them",
            )
        yield Bundle.open(logs[0])
        return
    if cache is not None:
        found = _kept(logs, options, cache)
        if found is not None:
            yield found
            return
    from slamreplay.ingest.pipeline import ingest

    with TemporaryDirectory(prefix="slamreplay-") as folder:
        with progress_bar("reading") as progress:
            bundle = ingest(logs, keep or Path(folder) / "log.bundle", options, progress=progress)
        yield bundle


def _kept(logs: Sequence[Path], options: IngestOptions, cache: Path) -> Bundle | None:
    from slamreplay.cli.progress import progress_bar
    from slamreplay.errors import OutputError
    from slamreplay.ingest.bundle_cache import ingest_once

    try:
        with progress_bar("reading") as progress:
            return ingest_once(logs, cache, options, progress=progress)
    except (OSError, OutputError):
        return None
