"""Jumps and traces as lines of plain text, for the terminal."""

from __future__ import annotations

from collections.abc import Iterator

from slamreplay.consistency.belief.jumps.check import sentence
from slamreplay.evidence.ledger import run_name
from slamreplay.evidence.result import Postmortem
from slamreplay.report.tables import Table
from slamreplay.report.trace_tables import trace_note, traces

#: Jumps of one run that are told here; the report has all.
_JUMPS = 3


def trace_lines(post: Postmortem) -> Iterator[str]:
    """The grave jumps of undisturbed runs, and a table for each where a moment was asked for.

    A run that is made to break jumps all the time: that is in the report, and no news here.
    """
    for trial, found in post.jumps:
        if trial.perturbation is not None:
            continue
        grave = sorted((j for j in found if j.step.is_grave), key=lambda j: -j.step.size)
        for jump in grave[:_JUMPS]:
            yield f"{run_name(trial)} jumped {sentence(jump, post.manifest.start_ns)}"
        if len(grave) > _JUMPS:
            more = len(grave) - _JUMPS
            yield f"{run_name(trial)} jumped {more} more time{'s' if more > 1 else ''} as far"
    if post.trace_ns is not None:
        yield trace_note(post)
        for name, rows in traces(post):
            yield ""
            yield name
            yield from _grid(rows)
        yield ""


def _grid(rows: Table) -> Iterator[str]:
    lines = [list(rows.head), *([cell.text for cell in row] for row in rows.rows)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(rows.head))]
    for line in lines:
        yield "  ".join(
            cell.ljust(width) for cell, width in zip(line, widths, strict=True)
        ).rstrip()
    if rows.more:
        yield f"{rows.more} more in {rows.more_in}"
