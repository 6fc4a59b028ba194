"""What a design writes beside its runs: numbers, page and picture."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from slamreplay.bundle.view import Bundle
from slamreplay.doses.answer import Answer
from slamreplay.doses.page import PAGE, RESULTS, results_json, results_page
from slamreplay.doses.plan import Plan
from slamreplay.replay.dose_file import DOSES, doses_json
from slamreplay.replay.folder import write_runs
from slamreplay.report.dose_tables import words_of

FIGURE = "doses"


def write_answer(
    target: Path,
    bundle: Bundle,
    plan: Plan,
    found: Answer,
    log: Mapping[str, Any],
    *,
    keep_bundle: bool = False,
) -> None:
    """Write a RUNS folder with the answer of a design in it; it is whole or absent.

    Args:
        target: the folder; an earlier one of ours is replaced.
        bundle: what the runs are of, on disk.
        plan: what was asked.
        found: what came out.
        log: see `results_json`.
        keep_bundle: copy the bundle into the folder, for one that would else be gone.

    Raises:
        OutputError: somebody else's folder, or one that cannot be written.
    """
    from slamreplay.report.figures.canvas import plain_style, png_bytes, svg_bytes
    from slamreplay.report.figures.doses import doses_figure

    results = found.results
    beside = {
        DOSES: doses_json(results).encode(),
        RESULTS: results_json(plan, results, log).encode(),
        PAGE: results_page(results, (FIGURE,)).encode(),
    }
    with plain_style():
        figure = doses_figure(results, words_of(results))
        beside[f"{FIGURE}.svg"] = svg_bytes(figure)
        beside[f"{FIGURE}.png"] = png_bytes(figure)
    write_runs(target, bundle, found.runs, keep_bundle=keep_bundle, beside=beside)
