"""The page's and the terminal's tables of jumps, and of what moved the belief around a moment."""

from __future__ import annotations

import math

from slamreplay.evidence.ledger import LEDGER_FILE, run_name
from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.trace import RunTrace, Traced
from slamreplay.report.cells import Cell, Table, table
from slamreplay.report.moments import moment_cell
from slamreplay.report.phrases import NOT_KNOWN, number, seconds, short

_HEAD = ("when", "measured", "moved it by", "residual", "sigma of it", "NIS", "score", "used")
#: Rows of one run on the page and in the terminal.
_SHOWN = 12


def jumps(post: Postmortem) -> Table:
    """Every jump of every run, the recorded localizer first."""
    rows = [
        (
            run_name(trial),
            moment_cell(post, jump.step.t_ns),
            _moved(jump.step.metres, jump.step.radians),
            _errors(jump.error_before_m, jump.error_after_m),
            jump.cause,
        )
        for trial, found in post.jumps
        for jump in found
    ]
    return table(("path", "when", "by", "off before and after", "what made it"), rows)


def traces(post: Postmortem) -> tuple[tuple[str, Table], ...]:
    """For each run its name and the rows around the moment that was asked for."""
    return tuple((_title(one), _rows(post, one)) for one in post.traces)


def trace_note(post: Postmortem) -> str:
    """How to read the tables; empty where nothing was asked."""
    if post.trace_ns is None:
        return ""
    when = seconds(post.trace_ns - post.manifest.start_ns)
    if not post.traces:
        return f"No run has a ledger that could tell what moved the belief around {when}."
    text = f"Measurements within 5 s of {when}, those that moved the belief most first. "
    if post.recorded:
        text += "What a recorded localizer measured nobody recorded: only how far each of its "
        text += "words moved it. "
    return f"{text}{LEDGER_FILE} has every row."


def _title(one: RunTrace) -> str:
    name = run_name(one.trial)
    return name if one.near else f"{name}: nothing within 5 s, the nearest"


def _rows(post: Postmortem, one: RunTrace) -> Table:
    shown = table(_HEAD, [_row(post, traced) for traced in one.rows[:_SHOWN]])
    columns = zip(shown.head, *shown.rows, strict=True)
    told = [column for column in columns if {cell.text for cell in column[1:]} != {NOT_KNOWN}]
    head, *rows = zip(*told, strict=True)
    return Table(head, tuple(rows), max(0, len(one.rows) - _SHOWN), LEDGER_FILE)


def _row(post: Postmortem, one: Traced) -> tuple[str | Cell, ...]:
    seen = one.set
    axes = [axis.rpartition(" ") for axis in seen.axes]
    names = [name or unit for name, _, unit in axes]
    units = [unit if name else "" for name, _, unit in axes]
    residual = [float(r) for r in seen.residual[one.row]]
    names = names if len(names) == len(residual) else [""] * len(residual)
    units = units if len(units) == len(residual) else [""] * len(residual)
    score, about = float(seen.score[one.row]), str(seen.about[one.row])
    what = about if about.startswith(seen.source) else f"{seen.source}: {about}".removesuffix(": ")
    return (
        moment_cell(post, one.t_ns),
        Cell(what, seen.frame_id),
        _moved(one.metres, one.radians),
        _numbers(residual, names, units),
        _numbers(list(one.sigma), [""] * len(residual), units),
        short(one.nis),
        number(score, ".2f"),
        "yes" if seen.accepted[one.row] else "no",
    )


def _numbers(values: list[float], names: list[str], units: list[str]) -> str:
    if not any(math.isfinite(value) for value in values):
        return NOT_KNOWN
    words = []
    for value, name, unit in zip(values, names, units, strict=True):
        shown, factor = ("deg", math.degrees(1.0)) if unit == "rad" else (unit, 1.0)
        words.append(f"{name} {number(factor * value, '.3g', shown)}".strip())
    return ", ".join(words)


def _moved(metres: float, radians: float) -> str:
    if not math.isfinite(metres):
        return NOT_KNOWN
    return f"{number(metres, '.3f', 'm')}, {number(math.degrees(radians), '.1f', 'deg')}"


def _errors(before_m: float | None, after_m: float | None) -> str:
    if before_m is None or after_m is None:
        return NOT_KNOWN
    return f"{before_m:.2f} m, {after_m:.2f} m"
