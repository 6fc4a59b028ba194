"""The whole benchmark of root causes: cases on several processes, resumed where it stopped."""

from __future__ import annotations

import json
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from slamreplay.bench.cause_answers import ANSWERERS
from slamreplay.bench.cause_measure import measured_cause
from slamreplay.bench.cause_scores import cause_scores, is_named
from slamreplay.bench.cause_table import causes_page
from slamreplay.bench.incidents import ALL_KINDS
from slamreplay.bench.measure import Measured
from slamreplay.bench.resumed import RESULTS, played_into
from slamreplay.bench.runner import PAGE
from slamreplay.bench.schedule import Case, Split, schedule
from slamreplay.bench.store import fingerprint
from slamreplay.bundle.atomic import write_file
from slamreplay.report.figures import canvas
from slamreplay.report.figures.confusion import confusion_figure
from slamreplay.report.figures.reliability import reliability_figure
from slamreplay.verdict.reliability import Bin, Reliability

#: Ten rounds of all kinds.
DEFAULT_LOGS = 10 * len(ALL_KINDS)


def run_causes(
    target: Path,
    *,
    logs: int = DEFAULT_LOGS,
    seed: int = 0,
    split: Split = "held",
    kinds: Sequence[str] = ALL_KINDS,
    answerers: Sequence[str] = tuple(ANSWERERS),
    jobs: int = 2,
    progress: Callable[[str, float], None] | None = None,
) -> dict[str, Any]:
    """Name the causes of incidents; write results.json, results.md and the figures; the results.

    Logs of which the same code has named the cause before in this folder are not played again.

    Raises:
        OutputError: the folder is somebody else's or cannot be written.
    """
    cases = schedule(logs, seed, split, kinds, ())
    code = f"{fingerprint()} {' '.join(answerers)}"
    play = partial(cause_or_failed, answerers=tuple(answerers))
    found = played_into(target, cases, code, jobs, play, progress)
    results = causes_of(found, seed, split, answerers)
    for name, scores in results["answerers"].items():
        _draw(target, name, scores, seed)
    write_file(target / PAGE, causes_page(results).encode())
    text = json.dumps(results, indent=1, allow_nan=False, sort_keys=True)
    write_file(target / RESULTS, text.encode())
    return results


def causes_of(
    found: Sequence[Measured], seed: int, split: Split, answerers: Sequence[str]
) -> dict[str, Any]:
    """All figures of each answerer, and what became of each case."""
    return {
        "complete": True,
        "seed": seed,
        "split": split,
        "logs": len(found),
        "answerers": {name: cause_scores(found, name) for name in answerers},
        "cases": [_told(m, answerers) for m in found],
    }


def cause_or_failed(case: Case, answerers: Sequence[str]) -> Measured:
    """A case played; a fault of ours becomes its result, and the other cases go on."""
    try:
        return measured_cause(case, answerers)
    except Exception as error:  # whatever it is, it must stand in the table
        text = f"{type(error).__name__}: {error} at {traceback.extract_tb(error.__traceback__)[-1]}"
        return Measured(case, {"error": text})


def _told(one: Measured, answerers: Sequence[str]) -> dict[str, Any]:
    case, facts = one.case, one.facts
    said = {"case": case.name, "kind": case.kind, "seed": case.seed, **facts}
    if "error" not in facts:
        said["is_incident"] = facts["happened"] != "none" and bool(facts["accepted"])
        said["right"] = {name: is_named(one, name) for name in answerers}
    return said


def _draw(target: Path, name: str, scores: dict[str, Any], seed: int) -> None:
    """The confusion matrix and the reliability diagram of one answerer."""
    sure = scores["calibration"]
    record = Reliability(
        scores["incidents"], seed, sure["ece"], tuple(Bin(**b) for b in sure["bins"])
    )
    with canvas.plain_style():
        matrix = confusion_figure(scores["confusion"], canvas.WIDE)
        if matrix is not None:
            write_file(target / f"confusion_{name}.svg", canvas.svg_bytes(matrix))
            write_file(target / f"confusion_{name}.png", canvas.png_bytes(matrix))
        diagram = reliability_figure(record, canvas.BESIDE, answers="answers")
        if diagram is not None:
            write_file(target / f"reliability_{name}.svg", canvas.svg_bytes(diagram))
