"""slamreplay inspect: what a bundle or log holds, what it lacks, and how far its trials are."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import typer

from slamreplay.cli import options as o
from slamreplay.cli.columns import Cell, Tone
from slamreplay.cli.terminal import say, say_json, say_table


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
        say_json(answers, allow_nan=False)
        return
    whole = answers["bundle"]
    names = ", ".join(s["name"] for s in whole["sources"])
    say((f"bundle {whole['id']}", "head"), f": {names}, {whole['duration_s']:.1f} s", indent=2)
    _section("What is there", _roles(answers), numbers=(2, 3))
    if answers["missing"]:
        title = f"Missing of the eight parts: {len(answers['missing'])}"
        _section(title, _missing(answers))
    else:
        _nothing("Nothing is missing: all eight parts are there.")
    if answers["maps"]:
        _section("Maps, the last one holds at the end", _maps(answers))
    if not brief:
        _show_clock(answers)
        _show_frames(answers["frames"])
        if answers["findings"]:
            _section("Clocks, tf and numbers", _findings(answers))
        else:
            _nothing("Clocks, tf and numbers: nothing to remark.")
    if answers["losses"]:
        _section("Skipped, lost, repaired", _losses(answers), numbers=(2,))


def _section(
    title: str,
    rows: list[list[Cell]],
    *,
    numbers: Collection[int] = (),
    ends: Sequence[str] = (),
) -> None:
    say()
    say((title, "head"), indent=2)
    say_table(rows, numbers=numbers, ends=ends, indent=2)


def _nothing(text: str) -> None:
    say()
    say((text, "good"), indent=2)


def _number(value: float | None, digits: int = 3) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _roles(answers: dict[str, Any]) -> list[list[Cell]]:
    rows: list[list[Cell]] = [["role", "topic", "messages", "Hz", "why"]]
    for role in answers["roles"]:
        rate = _number(role["rate_hz"], 1)
        rows.append([role["role"], role["topic"], str(role["messages"]), rate, role["reason"]])
    return rows


def _missing(answers: dict[str, Any]) -> list[list[Cell]]:
    rows: list[list[Cell]] = [["part", "because", "so that"]]
    rows += ([(m["part"], "doubt"), m["reason"], m["consequence"]] for m in answers["missing"])
    return rows


def _maps(answers: dict[str, Any]) -> list[list[Cell]]:
    rows: list[list[Cell]] = [["version", "from", "cells", "m per cell", "held, s"]]
    start_ns = answers["bundle"]["start_ns"]
    for entry in answers["maps"]:
        size = f"{entry['width']} x {entry['height']}"
        spans = [tuple((t - start_ns) / 1e9 for t in span) for span in entry["held_ns"]]
        held = ", ".join(f"{first:.1f} to {last:.1f}" for first, last in spans)
        rows.append([entry["folder"], entry["source"], size, f"{entry['resolution_m']:g}", held])
    return rows


def _show_clock(answers: dict[str, Any]) -> None:
    clock = answers["clock"]
    say()
    say((f"clock: {clock['name']}", "head"), f", {clock['reason']}", indent=2)
    rows: list[list[Cell]] = [
        ["topic", "table", "rows", "Hz", "median s", "p95 s", "drift ppm", "gaps"]
    ]
    rows += (
        [
            topic["topic"],
            topic["table"],
            str(topic["rows"]),
            _number(topic["rate_hz"], 1),
            _number(topic["log_minus_stamp_median_s"]),
            _number(topic["log_minus_stamp_p95_s"]),
            _number(topic["drift_ppm"], 0),
            "-" if topic["gap_count"] is None else str(topic["gap_count"]),
        ]
        for topic in clock["topics"]
    )
    by = [t["by"] for t in clock["topics"]]
    ends = ["", *("" if how == "header stamp" else f"placed by {how}" for how in by)]
    _section("Log time minus header stamp", rows, numbers=range(2, 8), ends=ends)


_SEVERITY: dict[str, Tone] = {"error": "bad", "warning": "doubt", "info": "quiet"}


def _findings(answers: dict[str, Any]) -> list[list[Cell]]:
    rows: list[list[Cell]] = [["id", "severity", "what was found"]]
    for finding in answers["findings"]:
        severity = finding["severity"]
        rows.append([finding["id"], (severity, _SEVERITY[severity]), finding["message"]])
    return rows


def _show_frames(frames: dict[str, Any]) -> None:
    named = ", ".join(f"{name} {frames[name] or '-'}" for name in ("map", "odom", "base"))
    say()
    say(("frames", "head"), f": {named}", indent=2)
    below: dict[str, list[dict[str, Any]]] = {}
    for edge in frames["tree"]:
        below.setdefault(edge["parent"], []).append(edge)
    children = {edge["child"] for edge in frames["tree"]}

    def grow(frame: str, about: str, depth: int) -> None:
        say("  " * depth, f"{frame}{about}", indent=2 * depth + 4)
        for edge in below.get(frame, []):
            grow(edge["child"], f" ({_edge(edge)})", depth + 1)

    for root in sorted(set(below) - children):
        grow(root, "", 1)
    if frames["without_tf"]:
        names = ", ".join(frames["without_tf"])
        say(f"sensor frames without tf, taken to be the base: {names}", indent=2)


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


def _losses(answers: dict[str, Any]) -> list[list[Cell]]:
    rows: list[list[Cell]] = [["kind", "what", "count", "why"]]
    rows += ([x["kind"], x["what"], str(x["count"]), x["reason"]] for x in answers["losses"])
    return rows
