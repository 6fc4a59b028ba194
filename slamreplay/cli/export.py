"""`slamreplay export`: what was recorded, or what was replayed, for other tools."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from slamreplay.cli import options

#: The file by which an exported folder is known.
MARKER = "export.json"


class Format(StrEnum):
    """What can be written."""

    tum = "tum"


Source = Annotated[
    list[Path],
    typer.Argument(metavar="B|RUNS|LOG...", help="Bundle, folder of runs, or log."),
]
To = Annotated[Format, typer.Option("--to", help="Format to write.")]
Output = Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder to write.")]


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
    start_s: options.Start = None,
    end_s: options.End = None,
    as_json: options.Json = False,
) -> None:
    """Write trajectories for other tools: of RUNS one file per trial, of a bundle what it holds.

    One line per scan in the order of the log, the robot's base, stamps as recorded; a scan without
    a pose is a line of nan.
    """
    from slamreplay.bundle.atomic import atomic_folder, check_target
    from slamreplay.export.tum import bundle_as_tum, runs_as_tum
    from slamreplay.replay.folder import is_runs, read_runs

    check_target(output, MARKER)
    if len(source) == 1 and is_runs(source[0]):
        content = runs_as_tum(*read_runs(source[0]))
    else:
        how = options.ingest_options(
            map_yaml=map_yaml,
            topics=topics,
            robot=robot,
            reference=reference,
            start_s=start_s,
            end_s=end_s,
        )
        with options.evidence(source, how) as bundle:
            content = bundle_as_tum(bundle)
    head = {"format": to.value, "files": sorted(content)}
    with atomic_folder(output, marker=MARKER) as work:
        for name, text in content.items():
            (work / name).write_text(text, encoding="utf-8")
        (work / MARKER).write_text(json.dumps(head, indent=1) + "\n", encoding="utf-8")
    if as_json:
        typer.echo(json.dumps({"folder": str(output), **head}, indent=1))
        return
    for name in sorted(content):
        typer.echo(str(output / name))
