"""`slamreplay export`: what was recorded, replayed and found, for other tools."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from slamreplay.cli import options
from slamreplay.cli.terminal import complain, say_json, say_path
from slamreplay.export.formats import MARKER, Format, Only, Written, needs

if TYPE_CHECKING:
    from slamreplay.bundle.run import Run
    from slamreplay.bundle.view import Bundle
    from slamreplay.evidence.result import Postmortem
    from slamreplay.ingest.options import IngestOptions

Source = Annotated[
    list[Path],
    typer.Argument(metavar="B|RUNS|LOG...", help="Bundle, folder of runs, or log."),
]
To = Annotated[
    Format,
    typer.Option(
        "--to",
        help="tum: trajectories, of RUNS one file per trial. csv: tables and answers. mcap: the "
        "recorded evidence as a ROS 2 log, and the answers as Foxglove's messages with a layout. "
        "rerun: an .rrd. rviz: map, overlays and a configuration.",
    ),
]
Output = Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder to write.")]
Start = Annotated[
    float | None,
    typer.Option(
        "--start",
        metavar="S",
        help="Write nothing earlier, in s from the start. What is judged is always the whole log.",
    ),
]
End = Annotated[
    float | None,
    typer.Option("--end", metavar="S", help="Write nothing later, in s from the start."),
]
OnlyPart = Annotated[
    Only | None,
    typer.Option("--only", help="Of mcap and csv one half; recorded evidence alone is fast."),
]
Covariance = Annotated[
    bool,
    typer.Option(
        "--covariance",
        help="With --to tum: beside each file one with covariances, as OpenVINS writes them.",
    ),
]
Redact = Annotated[
    bool,
    typer.Option(
        "--redact",
        help="Replace names of robots, topics, frames, nodes and files, and drop texts of logs. "
        "The map's shape, poses and times stay, and tell where and when to whoever knows the "
        "place.",
    ),
]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("export")(export)


def export(
    source: Source,
    to: To,
    output: Output,
    map_yaml: options.MapYaml = None,
    topics: options.Topics = None,
    robot: options.Robot = None,
    reference: options.Reference = None,
    start_s: Start = None,
    end_s: End = None,
    only: OnlyPart = None,
    covariance: Covariance = False,
    redact: Redact = False,
    as_json: options.Json = False,
) -> None:
    """Write what was recorded, replayed and found for other tools.

    A trajectory has one line per scan in the order of the log, the robot's base, stamps as
    recorded; a scan without a pose is a line of nan. --start and --end cut what is written, not
    what is judged: with all of its evidence a log is judged better.
    """
    from slamreplay.bundle.atomic import check_target
    from slamreplay.cli.progress import progress_bar
    from slamreplay.export.writers import Request, redacted, window_of, write_export

    halves = needs(to, only, covariance=covariance)
    check_target(output, MARKER)
    how = options.ingest_options(
        map_yaml=map_yaml,
        topics=topics,
        robot=robot,
        reference=reference,
        start_s=None,
        end_s=None,
    )
    with _evidence(source, how) as (bundle, runs):
        window = window_of(bundle, start_s, end_s)
        if redact:
            bundle, runs = redacted(bundle, runs)
        post = _looked_back(bundle, runs) if halves.analysis else None
        with progress_bar("writing") as progress:
            request = Request(
                bundle,
                runs,
                window,
                post,
                _report_of(post) if to is Format.MCAP else None,
                halves.recorded,
                covariance,
                redact,
                progress,
            )
            written = write_export(request, to, output)
    _tell(written, output, as_json=as_json)


@contextmanager
def _evidence(source: Sequence[Path], how: IngestOptions) -> Iterator[tuple[Bundle, Sequence[Run]]]:
    from slamreplay.errors import UsageError
    from slamreplay.ingest.options import IngestOptions
    from slamreplay.replay.folder import is_runs, read_runs

    if len(source) == 1 and is_runs(source[0]):
        if how != IngestOptions():
            raise UsageError(
                "a folder of runs takes no options of a log",
                where=source[0],
                hint="its bundle was ingested already",
            )
        yield read_runs(source[0])
        return
    with options.evidence(source, how) as bundle:
        yield bundle, []


def _looked_back(bundle: Bundle, runs: Sequence[Run]) -> Postmortem:
    from slamreplay.cli.progress import progress_bar
    from slamreplay.postmortem import postmortem

    with progress_bar("looking back") as progress:
        return postmortem(bundle, runs, progress=progress)


def _report_of(post: Postmortem | None) -> str | None:
    from slamreplay.report.build import build

    return None if post is None else build(post).json_text()


def _tell(written: Written, output: Path, *, as_json: bool) -> None:
    """The files on stdout; on stderr what they do not hold as it was recorded."""
    for missed in written.not_as_recorded:
        complain(f"not as recorded: {missed.what}: {missed.count}, {missed.reason}")
    if as_json:
        say_json({"folder": str(output), **written.head})
        return
    for name in written.files:
        say_path(output / name)
