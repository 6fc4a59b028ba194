"""slamreplay ingest: a log into a bundle."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from slamreplay.cli import options as o


def register(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command(name="ingest")(ingest)


def ingest(
    logs: o.Logs,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="BUNDLE", help="Folder of the bundle.")
    ],
    map_yaml: o.MapYaml = None,
    topics: o.Topics = None,
    robot: o.Robot = None,
    reference: o.Reference = None,
    start: o.Start = None,
    end: o.End = None,
    json: o.Json = False,
) -> None:
    """Read a log into a bundle: immutable, columnar, hashed."""
    from slamreplay.cli.inspect import show
    from slamreplay.cli.progress import progress_bar
    from slamreplay.cli.terminal import complain
    from slamreplay.consistency.audits.inspection import inspect, summary
    from slamreplay.ingest.pipeline import ingest as run

    given = o.ingest_options(
        map_yaml=map_yaml, topics=topics, robot=robot, reference=reference, start_s=start, end_s=end
    )
    with progress_bar("reading") as progress:
        bundle = run(logs, output, given, progress=progress)
    show(inspect(bundle) if json else summary(bundle), as_json=json, brief=True)
    complain(f"wrote {output}")
