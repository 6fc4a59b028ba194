"""slamreplay inspect: what a bundle or log holds, what it lacks, and how far its trials are."""

from __future__ import annotations

import json as jsonlib
import sys
from typing import TYPE_CHECKING, Any

import typer

from slamreplay.cli import options as o

if TYPE_CHECKING:
    from rich.table import Table


def register(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command(name="inspect")(inspect)


def inspect(
    logs: o.Logs,
    map_yaml: o.MapYaml = None,
    topics: o.Topics = None,
    robot: o.Robot = None,
    reference: o.Reference = None,
    start: o.Start = None,
    end: o.End = None,
    json: o.Json = False,
) -> None:
    """Show what is in a bundle or log, what is missing, and whether its clocks and tf hold.

    Of a folder of runs, also while perturb makes it or after that was interrupted: which trials are
    done, running and waiting, the time left, and the numbers so far.
    """
    from slamreplay.cli.inspect_runs import answers_of, show_runs
    from slamreplay.ingest.options import IngestOptions

    given = o.ingest_options(
        map_yaml=map_yaml, topics=topics, robot=robot, reference=reference, start_s=start, end_s=end
    )
    if len(logs) == 1 and given == IngestOptions():
        runs = answers_of(logs[0])
        if runs is not None:
            show_runs(runs, as_json=json)
            return
    from slamreplay.consistency.audits.inspection import inspect as look

    with o.evidence(logs, given) as bundle:
        show(look(bundle), as_json=json)


def show(answers: dict[str, Any], *, as_json: bool, brief: bool = False) -> None:
    """Print the answers on stdout; `brief` leaves the audit out."""
    if as_json:
        typer.echo(jsonlib.dumps(answers, indent=1, allow_nan=False))
        return
    from rich.console import Console

    # A pipe has no width of its own; lines for a file need not be folded to 80 columns.
    console = Console(width=None if sys.stdout.isatty() else 160, highlight=False)
    whole = answers["bundle"]
    names = ", ".join(s["name"] for s in whole["sources"])
    console.print(f"bundle {whole['id']}: {names}, {whole['duration_s']:.1f} s", markup=False)
    console.print(_roles(answers))
    console.print(_missing(answers))
    if answers["maps"]:
        console.print(_maps(answers))
    if not brief:
        clock = answers["clock"]
        console.print(f"clock: {clock['name']}, {clock['reason']}", markup=False)
        console.print(_clock(answers))
        _print_frames(console, answers["frames"])
        console.print(_findings(answers))
    if answers["losses"]:
        console.print(_losses(answers))


#: Columns of numbers.
_RIGHT = frozenset({"messages", "Hz", "count", "rows", "median s", "p95 s", "drift ppm", "gaps"})


def _grid(title: str, *columns: str) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    for column in columns:
        right = column in _RIGHT
        name = column in ("role", "topic", "table", "what", "id")
        table.add_column(
            column, justify="right" if right else "left", overflow="fold", no_wrap=name
        )
    return table


def _number(value: float | None, digits: int = 3) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _text(value: object) -> str:
    from rich.markup import escape

    return escape(str(value))


def _roles(answers: dict[str, Any]) -> Table:
    table = _grid("What is there", "role", "topic", "messages", "Hz", "why")
    for role in answers["roles"]:
        table.add_row(
            role["role"],
            _text(role["topic"]),
            str(role["messages"]),
            _number(role["rate_hz"], 1),
            _text(role["reason"]),
        )
    return table


def _missing(answers: dict[str, Any]) -> Table | str:
    if not answers["missing"]:
        return "Nothing is missing: all eight parts are there."
    title = f"Missing of the eight parts: {len(answers['missing'])}"
    table = _grid(title, "part", "because", "so that")
    for part in answers["missing"]:
        table.add_row(part["part"], _text(part["reason"]), _text(part["consequence"]))
    return table


def _maps(answers: dict[str, Any]) -> Table:
    title = "Maps, the last one holds at the end"
    table = _grid(title, "version", "from", "cells", "m per cell", "held, s")
    start_ns = answers["bundle"]["start_ns"]
    for entry in answers["maps"]:
        size = f"{entry['width']} x {entry['height']}"
        resolution = f"{entry['resolution_m']:g}"
        spans = [tuple((t - start_ns) / 1e9 for t in span) for span in entry["held_ns"]]
        held = ", ".join(f"{first:.1f} to {last:.1f}" for first, last in spans)
        table.add_row(entry["folder"], _text(entry["source"]), size, resolution, held)
    return table


def _clock(answers: dict[str, Any]) -> Table:
    title = "Log time minus header stamp"
    table = _grid(title, "topic", "table", "rows", "Hz", "median s", "p95 s", "drift ppm", "gaps",
                  "placed by")  # fmt: skip
    for topic in answers["clock"]["topics"]:
        table.add_row(
            _text(topic["topic"]),
            topic["table"],
            str(topic["rows"]),
            _number(topic["rate_hz"], 1),
            _number(topic["log_minus_stamp_median_s"]),
            _number(topic["log_minus_stamp_p95_s"]),
            _number(topic["drift_ppm"], 0),
            "-" if topic["gap_count"] is None else str(topic["gap_count"]),
            topic["by"],
        )
    return table


def _findings(answers: dict[str, Any]) -> Table | str:
    if not answers["findings"]:
        return "Clocks, tf and numbers: nothing to remark."
    table = _grid("Clocks, tf and numbers", "id", "severity", "what was found")
    for finding in answers["findings"]:
        table.add_row(finding["id"], finding["severity"], _text(finding["message"]))
    return table


def _print_frames(console: Any, frames: dict[str, Any]) -> None:
    from rich.tree import Tree

    named = ", ".join(f"{name} {frames[name] or '-'}" for name in ("map", "odom", "base"))
    console.print(f"frames: {named}", markup=False)
    below: dict[str, list[dict[str, Any]]] = {}
    for edge in frames["tree"]:
        below.setdefault(edge["parent"], []).append(edge)
    children = {edge["child"] for edge in frames["tree"]}

    def grow(node: Tree, frame: str) -> None:
        for edge in below.get(frame, []):
            grow(node.add(f"{_text(edge['child'])} ({_edge(edge)})"), edge["child"])

    for root in sorted(set(below) - children):
        tree = Tree(_text(root))
        grow(tree, root)
        console.print(tree)
    if frames["without_tf"]:
        names = ", ".join(frames["without_tf"])
        console.print(f"sensor frames without tf, taken to be the base: {names}", markup=False)


def _edge(edge: dict[str, Any]) -> str:
    if edge["is_static"]:
        return "static"
    words = [f"{edge['samples']} samples"]
    if edge["rate_hz"] is not None:
        words.append(f"{edge['rate_hz']:.1f} Hz")
    if edge["ahead_s"] is not None:
        words.append(f"dated {edge['ahead_s']:.3f} s ahead of the {edge['ahead_of']}")
    if edge["gaps"]:
        words.append(f"{edge['gaps']} gaps up to {edge['longest_gap_s']:.2f} s")
    return ", ".join(words)


def _losses(answers: dict[str, Any]) -> Table:
    table = _grid("Skipped, lost, repaired", "kind", "what", "count", "why")
    for loss in answers["losses"]:
        table.add_row(loss["kind"], _text(loss["what"]), str(loss["count"]), _text(loss["reason"]))
    return table
