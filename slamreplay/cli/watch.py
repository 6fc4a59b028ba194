"""`slamreplay watch`: post-mortems of logs as they come."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
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
from slamreplay.cli.terminal import complain, say_json
from slamreplay.errors import LogError, UsageError

if TYPE_CHECKING:
    from slamreplay.batch.finished import Finished
    from slamreplay.batch.task import LogSource
    from slamreplay.batch.watch import Tally

_FAILED, _UNREADABLE = 1, 2
#: So many logs are done between two looks, or so many of each worker where those are more: at the
#: end of a round some wait for the last one.
_PER_ROUND, _PER_WORKER, _PER_ROUND_OF_CLUSTER = 32, 8, 512
#: So many of what never became whole are told at the end; all of them were told when it was seen.
_MOST_LACKING = 10
_LONGEST_S = 366 * 86_400.0
#: The hook may take so long, s.
_HOOK_S = 60.0

Folder = Annotated[
    str, typer.Argument(metavar="DIR", help="Where logs come in: a folder or an address (s3://...)")
]
Every = Annotated[
    float, typer.Option("--every", metavar="S", min=0.1, help="Time between two looks, in s.")
]
Settle = Annotated[
    float,
    typer.Option(
        "--settle", metavar="S", min=0.0, help="Nobody may have written to a log for so long, in s."
    ),
]
GiveUp = Annotated[
    float,
    typer.Option(
        "--give-up",
        metavar="S",
        min=0.0,
        help="A log that nobody closed is taken as it is after so long, in s.",
    ),
]
Once = Annotated[
    bool,
    typer.Option("--once", help="One look, for cron; exit with 1 where a gate failed."),
]
OnFinished = Annotated[
    str | None,
    typer.Option(
        "--on-finished", metavar="COMMAND", help="Run for each log, with JSON on its stdin."
    ),
]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(name="watch", help="Look back on logs of a folder as they become whole, for ever.")(
        _watch
    )


def _watch(
    folder: Folder,
    output: Output,
    recipe: Recipe = None,
    maps: Maps = None,
    storage: Storage = None,
    every_s: Every = 30.0,
    settle_s: Settle = 10.0,
    give_up_s: GiveUp = 3600.0,
    once: Once = False,
    workers: Count = None,
    memory_limit: MemoryLimit = None,
    scheduler: Scheduler = None,
    log_timeout_s: LogTimeout = 7200.0,
    cause: Cause = True,
    on_finished: OnFinished = None,
    as_json: Json = False,
) -> None:
    from slamreplay.batch.cluster import Workers
    from slamreplay.batch.keys import task_maker
    from slamreplay.batch.settling import Patience, Settling
    from slamreplay.batch.stopping import Stopped, stoppable
    from slamreplay.batch.stores import storage_options
    from slamreplay.batch.watch import Pace, Tally, served, watch
    from slamreplay.batch.whole import completeness
    from slamreplay.recipes import read_demands

    who = Workers(workers, memory_limit, scheduler, log_timeout_s).checked()
    _check_apart(folder, output)
    _check_times(every=every_s, settle=settle_s, give_up=give_up_s)
    hook = _hook(on_finished)
    demands = None if recipe is None else read_demands(recipe)
    options = storage_options(storage or ())
    tell = _new_only(complain)
    here = max(_PER_ROUND, _PER_WORKER * (workers or os.cpu_count() or 1))
    per_round = here if scheduler is None else _PER_ROUND_OF_CLUSTER
    tally = Tally()

    def finished(one: Finished) -> None:
        told = _as_json(one)
        if as_json:
            say_json(told, indent=None)
        complain(_line(one))
        hook(told)

    try:
        with stoppable():
            watch(
                output,
                lambda: _sources(folder, maps, options, tell),
                Settling(Patience(settle_s, give_up_s), completeness),
                task_maker(cause=cause, demands=demands, storage=options, keep_s=every_s),
                lambda scratch: served(who, scratch),
                pace=Pace(every_s, per_round, is_once=once),
                tell=complain,
                finished=finished,
                finish_round=lambda: _write_page(output, tell),
                tally=tally,
            )
    except Stopped as stop:
        _show(tally, output)
        if not stop.is_terminated:
            raise typer.Exit(INTERRUPTED) from None
        raise typer.Exit(TERMINATED if once else 0) from None
    _show(tally, output)
    if tally.failed or tally.gate_failed:
        raise typer.Exit(_UNREADABLE if tally.failed else _FAILED)


def _check_apart(folder: str, output: Path) -> None:
    """Refuse an output within the folder: each look would go through all reports."""
    from slamreplay.batch.addresses import local_path

    if Path(local_path(folder)).resolve() in (output.resolve(), *output.resolve().parents):
        raise UsageError("lies in the folder that is watched", where=output, hint="give another -o")


def _check_times(**seconds: float) -> None:
    """Refuse what no clock comes to."""
    for name, value in seconds.items():
        if not value <= _LONGEST_S:
            option = f"--{name.replace('_', '-')}"
            raise UsageError(f"{option} {value:g} is no time to wait", hint="in s, a year at most")


def _sources(
    folder: str, maps: str | None, storage: dict[str, object], tell: Callable[[str], None]
) -> list[LogSource]:
    """The logs there are now; the table is read at every look, so that robots can be added."""
    from slamreplay.batch.addresses import is_local
    from slamreplay.batch.maps_table import read_maps_table
    from slamreplay.batch.sources import NoLogError, sources_of

    if is_local(folder) and not Path(folder).is_dir():
        raise LogError("there is no such folder", where=folder)
    table = None if maps is None else read_maps_table(maps, storage)
    try:
        return sources_of([folder], table, storage, tell=tell)
    except NoLogError:
        return []  # none yet


def _new_only(tell: Callable[[str], None]) -> Callable[[str], None]:
    """Tells what was not told before; what only counts otherwise was."""
    told: set[str] = set()

    def say(line: str) -> None:
        plain = re.sub(r"\d+", "", line)
        if plain not in told:
            told.add(plain)
            tell(line)

    return say


def _write_page(output: Path, tell: Callable[[str], None]) -> None:
    from slamreplay.fleet.page.writer import write_fleet_page

    write_fleet_page(output, warn=tell)


def _hook(command: str | None) -> Callable[[dict[str, object]], None]:
    """Runs a command without a shell; what it says goes where ours goes."""
    import shlex

    try:
        words = shlex.split(command or "")
    except ValueError as error:
        raise UsageError(f"--on-finished: {error}") from error
    if command is not None and not words:
        raise UsageError("--on-finished has no command")
    return (lambda told: _run(words, told)) if words else (lambda _told: None)


def _run(words: Sequence[str], told: dict[str, object]) -> None:
    import json
    import subprocess

    text = json.dumps(told) + "\n"
    try:
        code = subprocess.run(words, input=text.encode(), timeout=_HOOK_S, check=False).returncode
    except subprocess.TimeoutExpired:
        complain(f"{words[0]}: took longer than {_HOOK_S:g} s and was ended")
    except OSError as error:
        complain(f"{words[0]}: {error.strerror or error}")
    else:
        if code:
            complain(f"{words[0]}: exit code {code}")


def _as_json(one: Finished) -> dict[str, object]:
    return {
        "time": _now(),
        "log": one.log,
        "key": one.key,
        "failed": one.has_failed,
        "state": one.state,
        "summary": one.summary,
        "gate": one.gate,
        "report": None if one.report is None else str(one.report),
    }


def _line(one: Finished) -> str:
    if one.has_failed:
        return f"{_now()} {one.log}: failed: {one.summary}"
    gate = "" if one.gate is None else f", gate {one.gate}"
    page = "" if one.report is None else f": {one.report / 'report.html'}"
    return f"{_now()} {one.log}: {one.state}{gate}{page}"


def _now() -> str:
    return f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}"


def _show(tally: Tally, output: Path) -> None:
    for log, reason in sorted(tally.lacking.items())[:_MOST_LACKING]:
        complain(f"{log}: not done: {reason}")
    if len(tally.lacking) > _MOST_LACKING:
        complain(f"and {len(tally.lacking) - _MOST_LACKING} more that are not done")
    parts = [f"{tally.finished} logs done"]
    parts += [f"{tally.failed} failed"] if tally.failed else []
    parts += [f"the gate failed in {tally.gate_failed}"] if tally.gate_failed else []
    parts += [f"{tally.moving} still being written"] if tally.moving else []
    complain(f"{', '.join(parts)}; all is kept in {output}: the same command goes on")
