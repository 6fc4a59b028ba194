"""What a design writes beside its runs: numbers, page and picture."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from slamreplay.bundle.kept import kept
from slamreplay.bundle.view import Bundle
from slamreplay.doses.answer import Answer
from slamreplay.doses.page import PAGE, RESULTS, results_json, results_page
from slamreplay.doses.plan import Plan
from slamreplay.replay.dose import DoseResults
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
    cache: Path | None = None,
) -> None:
    """Write a RUNS folder with the answer of a design in it; it is whole or absent.

    Args:
        target: the folder; an earlier one of ours is replaced.
        bundle: what the runs are of, on disk.
        plan: what was asked.
        found: what came out.
        log: see `results_json`.
        keep_bundle: copy the bundle into the folder, for one that would else be gone.
        cache: folder of what was computed earlier: pictures.

    Raises:
        OutputError: somebody else's folder, or one that cannot be written.
    """
    results = found.results
    doses = doses_json(results).encode()
    beside = {
        DOSES: doses,
        RESULTS: results_json(plan, results, log).encode(),
        PAGE: results_page(results, (FIGURE,)).encode(),
    }
    words, pictures = words_of(results), None if cache is None else cache / "pictures"
    told = [doses.decode(), repr(words), version("matplotlib")]
    for kind in ("svg", "png"):
        beside[f"{FIGURE}.{kind}"] = kept(
            pictures, [kind, *told], partial(_drawn, results, words, kind)
        )
    write_runs(target, bundle, found.runs, keep_bundle=keep_bundle, beside=beside)


def _drawn(results: DoseResults, words: dict[str, str], kind: str) -> bytes:
    from slamreplay.report.figures.canvas import plain_style, png_bytes, svg_bytes
    from slamreplay.report.figures.doses import doses_figure

    with plain_style():
        figure = doses_figure(results, words)
        return svg_bytes(figure) if kind == "svg" else png_bytes(figure)
