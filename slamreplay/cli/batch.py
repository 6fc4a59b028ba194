"""`slamreplay batch`: post-mortems of many logs, on this machine or a cluster."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from slamreplay.cli.batch_options import (
    INTERRUPTED,
    TERMINATED,
    Count,
    LogTimeout,
    Maps,
    MemoryLimit,
    Output,
    Recipe,
    Scheduler,
    Storage,
)
from slamreplay.cli.options import Cause, Json
from slamreplay.cli.terminal import complain, say, say_json, say_path

if TYPE_CHECKING:
    from slamreplay.batch.run import BatchEnd

#: So many failed logs are told with their line; all of them stand in the tables.
_MOST_FAILED = 10
_UNREADABLE = 2

Places = Annotated[
    list[str],
    typer.Argument(
        metavar="PLACE...",
        help="Folders, logs, patterns ('logs/**/*.mcap'), addresses (s3://...), manifests.",
    ),
]
AgainFailed = Annotated[
    bool, typer.Option("--again-failed", help="Try logs again that failed before.")
]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        name="batch", help="Look back on many logs; the same again does only what is missing."
    )(_batch)


def _batch(
    places: Places,
    output: Output,
    maps: Maps = None,
    recipe: Recipe = None,
    scheduler: Scheduler = None,
    workers: Count = None,
    memory_limit: MemoryLimit = None,
    log_timeout_s: LogTimeout = 7200.0,
    cause: Cause = True,
    again_failed: AgainFailed = False,
    storage: Storage = None,
    as_json: Json = False,
) -> None:
    from slamreplay.batch.cluster import Workers
    from slamreplay.batch.keys import task_maker
    from slamreplay.batch.maps_table import read_maps_table
    from slamreplay.batch.run import run_batch
    from slamreplay.batch.sources import sources_of
    from slamreplay.batch.stopping import Stopped, stoppable
    from slamreplay.batch.stores import storage_options
    from slamreplay.cli.progress import progress_bar
    from slamreplay.recipes import read_demands

    who = Workers(workers, memory_limit, scheduler, log_timeout_s).checked()
    demands = None if recipe is None else read_demands(recipe)
    options = storage_options(storage or ())
    try:
        with stoppable():
            table = None if maps is None else read_maps_table(maps, options)
            sources = sources_of(places, table, options, tell=complain)
            make = task_maker(cause=cause, demands=demands, storage=options)
            tasks = [make(source) for source in sources]
            with progress_bar("looking back") as progress:
                end = run_batch(
                    tasks, output, who, again_failed=again_failed, progress=progress, tell=complain
                )
    except Stopped as stop:
        complain(f"stopped; what is done is kept in {output}: the same command again goes on")
        raise typer.Exit(TERMINATED if stop.is_terminated else INTERRUPTED) from None
    if as_json:
        say_json(_as_json(end, output))
    else:
        _show(end)
        for line in end.fleet:
            say(line)
        say_path(end.page)
    if len(end.failed) == end.logs:
        complain(f"slamreplay: none of the {end.logs} logs could be looked back on")
        raise typer.Exit(_UNREADABLE)


def _as_json(end: BatchEnd, output: Path) -> dict[str, object]:
    return {
        "output": str(output),
        "page": str(end.page),
        "logs": end.logs,
        "kept": end.kept,
        "states": dict(end.states),
        "gates": dict(end.gates),
        "fleet": list(end.fleet),
        "failed": [{"log": log, "error": line} for log, line in end.failed],
        "done_mb": round(end.megabytes, 3),
        "seconds": round(end.seconds, 3),
    }


def _show(end: BatchEnd) -> None:
    now = end.logs - end.kept
    counts = [f"{count} {state}" for state, count in end.states.items()]
    counts += [f"{len(end.failed)} failed"] if end.failed else []
    say(f"{end.logs} logs: {', '.join(counts)}")
    if end.gates:
        say(f"gate: {', '.join(f'{count} {word}' for word, count in end.gates.items())}")
    kept = f", {end.kept} were there already" if end.kept else ""
    speed = f", {3600 * now / end.seconds:.0f} logs an hour" if now else ""
    say(f"{now} done in {end.seconds:.0f} s ({end.megabytes:.3g} MB{speed}){kept}")
    for log, line in end.failed[:_MOST_FAILED]:
        say(("! ", "bad"), line if log in line else f"{log}: {line}")
    if len(end.failed) > _MOST_FAILED:
        say(f"  and {len(end.failed) - _MOST_FAILED} more that failed, see the table logs")
    if end.failed:
        say("  they stay so; --again-failed tries them again")
