"""The answer as tables, sentences and a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

from slamreplay.labs.lab import LabResults, ResultTable
from slamreplay.labs.minimum_replay.questions import QUESTIONS, Answer
from slamreplay.report.figures.matrix import Cell, matrix_figure

Kept = Literal["same", "other", "none"]
_LEGEND = {
    "same": "the same answer as with all eight parts",
    "other": "another answer",
    "none": "no answer",
}
_SIGN = {"same": "", "other": " (other)", "none": ""}


class Row(NamedTuple):
    """A log without a part: what was answered, and what the manifest says is missing."""

    log: str
    part: str | None
    answers: Mapping[str, Answer]
    missing: tuple[str, ...]


def results(rows: Sequence[Row], verdicts: Mapping[str, str]) -> LabResults:
    """What is left of each log.

    Args:
        rows: of each log the whole one first, then without each part.
        verdicts: by log, the true state.
    """
    whole = {row.log: row for row in rows if row.part is None}
    kept = [(row, _kept(row, whole[row.log])) for row in rows]
    tables = [
        ResultTable(
            f"{log.replace('_', ' ')}, in truth {truth.replace('_', ' ')}",
            ("without", *QUESTIONS),
            [_cells(row, how) for row, how in kept if row.log == log],
            brief=("without", *list(QUESTIONS)[:4]),
        )
        for log, truth in verdicts.items()
    ]
    numbers = {
        log: {
            "truth": truth,
            "without": {row.part or "nothing": _numbers(row, how)
                        for row, how in kept if row.log == log},
        }
        for log, truth in verdicts.items()
    }  # fmt: skip
    notes = [
        (
            "other: the words are different, or a number is by more than a tenth; an empty cell is "
            "a question without an answer."
        ),
        (
            "where it was: 95 % of hindsight's poses are as near to the simulator's, which no log "
            "holds here. Motions and recoveries that the gate allows, of all that could be asked, "
            "and their mean clearance. Stops, then recoveries, as recorded or as inferred."
        ),
    ]
    titles = {log: tables[k].title for k, log in enumerate(verdicts)}
    return LabResults(
        numbers={"logs": numbers},
        tables=tables,
        notes=notes,
        figures={"minimum_replay": lambda: matrix_figure(_matrices(kept, titles), _LEGEND)},
    )


def _kept(row: Row, whole: Row) -> dict[str, Kept]:
    """By question, what became of its answer."""
    out: dict[str, Kept] = {}
    for name, answer in row.answers.items():
        before = whole.answers[name]
        out[name] = "same" if answer.is_same(before) else "other" if answer.known else "none"
    return out


def _cells(row: Row, kept: Mapping[str, Kept]) -> tuple[str, ...]:
    answers = [row.answers[name].text + _SIGN[kept[name]] for name in QUESTIONS]
    return (row.part or "nothing", *answers)


def _numbers(row: Row, kept: Mapping[str, Kept]) -> dict[str, Any]:
    return {
        "missing": list(row.missing),
        "answers": {name: answer.text or None for name, answer in row.answers.items()},
        "became": dict(kept),
    }


def _matrices(
    kept: Sequence[tuple[Row, Mapping[str, Kept]]], titles: Mapping[str, str]
) -> dict[str, dict[str, list[Cell]]]:
    """By title of the log and by part the cells of a row, in the order of the questions."""
    return {
        title: {
            f"no {row.part}" if row.part else "all eight": [
                Cell(name, row.answers[name].text or "no answer", how[name]) for name in QUESTIONS
            ]
            for row, how in kept
            if row.log == log
        }
        for log, title in titles.items()
    }
