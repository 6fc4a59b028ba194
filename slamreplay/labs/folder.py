"""A lab's answer as a folder: results.json, results.md and the figures as SVG and PNG."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from slamreplay.bundle.atomic import atomic_folder, check_target
from slamreplay.errors import OutputError
from slamreplay.labs.lab import LabResults, ResultTable

RESULTS, PAGE, RESULTS_FORMAT = "results.json", "results.md", 1


def check_results_target(target: Path) -> None:
    """Refuse a folder that is no earlier answer of a lab, before any work is spent on it.

    Raises:
        OutputError: `target` cannot be written, or is somebody else's: a results.json alone does
            not make it ours.
    """
    check_target(target, RESULTS)
    if (target / RESULTS).exists():
        try:
            found = json.loads((target / RESULTS).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            found = None
        if not isinstance(found, dict) or "results_format" not in found:
            raise OutputError(
                f"its {RESULTS} is of something else", where=target, hint="name another with -o"
            )


def write_results(target: Path, head: dict[str, Any], results: LabResults) -> None:
    """Write an answer so that the folder is whole or absent; an earlier one is replaced.

    Args:
        target: the folder.
        head: what was asked: question, lab, seed and parameters.
        results: what came out.

    Raises:
        OutputError: somebody else's folder, or one that cannot be written.
    """
    from slamreplay.report.figures.canvas import plain_style, png_bytes, svg_bytes

    check_results_target(target)
    with atomic_folder(target, marker=RESULTS) as work, plain_style():
        (work / RESULTS).write_text(results_json(head, results), encoding="utf-8")
        (work / PAGE).write_text(_page(head, results), encoding="utf-8")
        for name, draw in results.figures.items():
            figure = draw()
            (work / f"{name}.svg").write_bytes(svg_bytes(figure))
            (work / f"{name}.png").write_bytes(png_bytes(figure))


def results_json(head: dict[str, Any], results: LabResults) -> str:
    """What was asked and the numbers, as JSON."""
    content = {"results_format": RESULTS_FORMAT, **head, "results": dict(results.numbers)}
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def _page(head: dict[str, Any], results: LabResults) -> str:
    lines = [f"# {head['question']}", ""]
    for table in results.tables:
        lines += [f"## {table.title}", "", *_markdown(table), ""]
    lines += [f"- {note}" for note in results.notes] + [""]
    lines += [f"![{name}]({name}.png)" for name in results.figures]
    return "\n".join(lines) + "\n"


def _markdown(table: ResultTable) -> list[str]:
    rows = [table.head, ["---"] * len(table.head), *table.rows]
    return [f"| {' | '.join(row)} |" for row in rows]
