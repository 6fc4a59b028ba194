"""`slamreplay report`: verdict and evidence of one log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from slamreplay.bundle.findings import SEVERITIES, Severity
from slamreplay.cli import completion
from slamreplay.cli.options import (
    Cause,
    End,
    Json,
    MapYaml,
    Reference,
    Robot,
    Start,
    Topics,
    evidence,
    ingest_options,
)
from slamreplay.cli.terminal import complain, say_json
from slamreplay.errors import UsageError

if TYPE_CHECKING:
    from slamreplay.bundle.run import Run
    from slamreplay.bundle.view import Bundle
    from slamreplay.evidence.result import Postmortem
    from slamreplay.ingest.options import IngestOptions
    from slamreplay.replay.dose import DoseResults

Evidence = Annotated[
    list[Path],
    typer.Argument(
        metavar="LOG...",
        help="A log (several files are one log), a bundle, or a folder of runs from perturb.",
    ),
]
Output = Annotated[
    Path,
    typer.Option("-o", "--output", metavar="DIR", help="Where report.html and its kin go."),
]
FailOn = Annotated[
    str | None,
    typer.Option(
        "--fail-on",
        metavar="SEVERITY",
        help="Exit with 1 on findings of info, warning or error, and of what is worse.",
        autocompletion=completion.severities,
    ),
]
UpdateMap = Annotated[
    Path | None,
    typer.Option(
        "--update-map",
        metavar="YAML",
        help="Write a corrected map here: a proposal that touches only what the log saw.",
    ),
]

Figures = Annotated[
    Path | None,
    typer.Option(
        "--figures",
        metavar="DIR",
        help="Write each figure here as PNG and SVG for papers and tickets, with captions.",
    ),
]

Trace = Annotated[
    float | None,
    typer.Option(
        "--trace",
        metavar="S",
        help="Tell which measurements moved the belief around this moment, in s from the start.",
    ),
]

HoldOut = Annotated[
    list[str] | None,
    typer.Option(
        "--hold-out",
        metavar="KIND",
        help="Keep fiducial, dock or gnss out of hindsight, so that it can judge it.",
        autocompletion=completion.held_out,
    ),
]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(name="report", help="Say whether the robot was lost or the map had changed.")(
        _report
    )


def _report(
    logs: Evidence,
    output: Output,
    map_yaml: MapYaml = None,
    topics: Topics = None,
    robot: Robot = None,
    reference: Reference = None,
    start_s: Start = None,
    end_s: End = None,
    update_map: UpdateMap = None,
    figures: Figures = None,
    trace: Trace = None,
    hold_out: HoldOut = None,
    cause: Cause = True,
    fail_on: FailOn = None,
    as_json: Json = False,
) -> None:
    from slamreplay.bundle.atomic import check_target
    from slamreplay.bundle.view import check_held_out
    from slamreplay.report import REPORT_FILE

    # All this before the work, not after it.
    threshold = _severity(fail_on)
    check_held_out(hold_out or ())
    check_target(output, REPORT_FILE)
    if update_map is not None:
        from slamreplay.report.map_proposal import check_proposal_target

        check_proposal_target(update_map)
    if figures is not None:
        from slamreplay.report.figure_files import check_figures_target

        check_figures_target(figures, output)
    options = ingest_options(
        map_yaml=map_yaml,
        topics=topics,
        robot=robot,
        reference=reference,
        start_s=start_s,
        end_s=end_s,
    )
    with _evidence(logs, options) as (bundle, runs, design):
        from slamreplay.cli.progress import progress_bar
        from slamreplay.evidence.trace import trace_time
        from slamreplay.postmortem import postmortem
        from slamreplay.report.build import build
        from slamreplay.report.writer import write_report

        manifest = bundle.manifest
        span = manifest.start_ns, manifest.end_ns
        trace_ns = None if trace is None else trace_time(trace, *span)

        with progress_bar("looking back") as progress:
            post = postmortem(
                bundle,
                runs,
                hold_out=hold_out or (),
                correct_map=update_map is not None,
                trace_ns=trace_ns,
                design=design,
                cause=cause,
                progress=progress,
            )
            page = write_report(post, output)
        if update_map is not None:
            _propose(post, update_map, map_yaml)
        if figures is not None:
            _draw(post, figures)
    if as_json:
        say_json(build(post).json_text())
    else:
        from slamreplay.cli.summary import show_summary

        show_summary(post, page)
    if threshold is not None and any(f.severity in _from(threshold) for f in post.findings):
        raise typer.Exit(1)


def _draw(post: Postmortem, target: Path) -> None:
    from slamreplay.report.figure_files import write_figures

    for path in write_figures(post, target):
        complain(f"figure: {path}")


def _propose(post: Postmortem, target: Path, original: Path | None) -> None:
    from slamreplay.report.map_proposal import write_proposal

    if post.grid is None:
        raise UsageError("there is no map to correct", hint="give the map with --map")
    changes = None if post.hindsight is None else post.hindsight.changes
    write_proposal(post.grid, changes, target, original)
    complain(f"corrected map: {target}")


@contextmanager
def _evidence(
    logs: Sequence[Path], options: IngestOptions
) -> Iterator[tuple[Bundle, list[Run], DoseResults | None]]:
    from slamreplay.ingest.options import IngestOptions
    from slamreplay.replay.dose_file import read_doses
    from slamreplay.replay.folder import is_runs, read_runs

    if len(logs) == 1 and is_runs(logs[0]):
        if options != IngestOptions():
            raise UsageError(
                "a folder of runs takes no options of a log",
                where=logs[0],
                hint="its bundle was ingested already",
            )
        yield *read_runs(logs[0]), read_doses(logs[0])
        return
    with evidence(logs, options) as bundle:
        yield bundle, [], None


def _severity(text: str | None) -> Severity | None:
    if text is None:
        return None
    for severity in SEVERITIES:
        if text == severity:
            return severity
    raise UsageError(f"there is no severity '{text}'", hint=f"there are: {', '.join(SEVERITIES)}")


def _from(threshold: Severity) -> tuple[Severity, ...]:
    return SEVERITIES[SEVERITIES.index(threshold) :]
