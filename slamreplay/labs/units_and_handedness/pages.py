"""The answer as tables, sentences and a picture."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Literal

from slamreplay.labs.lab import LabResults, ResultTable
from slamreplay.labs.units_and_handedness.trials import OFF_M, OFF_RAD, Confused, Ran
from slamreplay.report.figures.matrix import Cell, matrix_figure
from slamreplay.verdict.judgement import UNDECIDED

_TITLE = "Confusions on a healthy log"
_LEGEND = {
    "same": "as without the confusion",
    "other": "an estimator is off, the verdict another, a fault found",
    "none": "no pose, no verdict, nothing found",
}
Became = Literal["same", "other", "none"]


def results(found: Mapping[str | None, Confused]) -> LabResults:
    """What each confusion did.

    Args:
        found: by confusion, None for the log as it is, which comes first.
    """
    whole = found[None]
    rows = {name or "as recorded": _cells(one, whole) for name, one in found.items()}
    table = ResultTable(
        "What breaks, and who finds it",
        ("confusion", *(cell.question for cell in rows["as recorded"])),
        [(name, *(cell.text.replace("\n", " ") for cell in cells)) for name, cells in rows.items()],
    )
    notes = [
        (
            f"Estimators: largest error, and when it was beyond {OFF_M:g} m or "
            f"{math.degrees(OFF_RAD):.0f} deg first. Inspect and report: warnings and errors that "
            "the log as it is does not raise; by name: a finding names the unit or the hand."
        )
    ]
    return LabResults(
        numbers={"confusions": {name or "nothing": _numbers(one, whole)
                                for name, one in found.items()}},
        tables=[table],
        notes=notes,
        figures={"confusions": lambda: matrix_figure({_TITLE: rows}, _LEGEND)},
    )  # fmt: skip


def _cells(one: Confused, whole: Confused) -> list[Cell]:
    cells = [Cell(name, _error(ran), _of_run(ran)) for name, ran in one.ran.items()]
    lost: Became = "same" if one.state == whole.state else "other"
    if one.state in UNDECIDED:
        lost = "none"
    mode = "" if one.mode == "none" else f": {one.mode.replace('_', ' ')}"
    cells.append(Cell("verdict", f"{one.state.replace('_', ' ')}{mode}", lost))
    harmless = one is whole
    for title, ids in (("inspect", _new(one.audit, whole)), ("report", _new(one.report, whole))):
        became: Became = "same" if harmless else "other" if ids else "none"
        cells.append(Cell(title, " ".join(i.removeprefix("SR-") for i in ids) or "nothing", became))
    by_name: Became = "same" if harmless else "other" if one.named else "none"
    cells.append(Cell("by name", "yes" if one.named else "no", by_name))
    return cells


def _new(ids: tuple[str, ...], whole: Confused) -> list[str]:
    return [i for i in ids if i not in (*whole.audit, *whole.report)]


def _error(ran: Ran) -> str:
    if ran.error_m is None or ran.error_deg is None:
        return "no pose"
    far = f"{ran.error_m:.2f} m" if ran.error_m < 100.0 else f"{ran.error_m:.0f} m"
    return f"{far}, {ran.error_deg:.0f} deg"


def _of_run(ran: Ran) -> Became:
    if ran.error_m is None:
        return "none"
    return "same" if ran.off_s is None else "other"


def _numbers(one: Confused, whole: Confused) -> dict[str, Any]:
    def rounded(ran: Ran) -> dict[str, float | None]:
        return {k: None if v is None else float(f"{v:.4g}") for k, v in asdict(ran).items()}

    return {
        "estimators": {name: rounded(ran) for name, ran in one.ran.items()},
        "verdict": one.state,
        "failure_mode": one.mode,
        "inspect": _new(one.audit, whole),
        "report": _new(one.report, whole),
        "named": list(one.named),
    }
