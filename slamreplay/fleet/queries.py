"""The fleet's questions as SQL that DuckDB runs in a batch's folder, without this program.

`duckdb -c ".read queries.sql"` prints all answers. The texts stand in `sql/`; thresholds in them
are those of the modules that answer the same questions (`answering`), which a test compares.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import get_args

from slamreplay.consistency.statistics.shares import Z
from slamreplay.fleet import areas, changed_regions, course, in_use, picks, spots
from slamreplay.fleet.answers import DIMENSIONS, LEAST_LOGS, NEAR_M, SPOT_M
from slamreplay.fleet.cells import AGAINST_M2, LOOK_M2, SPOT
from slamreplay.fleet.counted import MEASURES
from slamreplay.fleet.intervals import z_of
from slamreplay.fleet.schema import PLACE_M, TABLES
from slamreplay.verdict.judgement import FailureKind

_WORDS = {"map_version": "map version", "software": "software version"}

#: Measures of one change of version, at most: no other failure is known.
_MOST_MEASURES = len(MEASURES) + len(get_args(FailureKind))

_VALUES: dict[str, object] = {
    "Z": Z,
    "Z_OF": [z_of(many) for many in range(1, _MOST_MEASURES + 1)],
    "SPOT": SPOT,
    "SPOT_M": SPOT_M,
    "SPOT_LOGS": spots.LEAST_LOGS,
    "SPOT_S": spots.LEAST_S,
    "PLACE_M": PLACE_M,
    "NEAR": round(NEAR_M / PLACE_M),
    "LOOK_M2": LOOK_M2,
    "AGAINST_M2": AGAINST_M2,
    "LATEST_LOOKS": areas.LATEST_LOOKS,
    "GAP": areas.GAP,
    "LOOK_SHARE": course.LOOK_SHARE,
    "AGAINST_SHARE": course.AGAINST_SHARE,
    "LEAST_M2": course.LEAST_M2,
    "AREA_LOGS": course.LEAST_LOGS,
    "AREA_ROBOTS": course.LEAST_ROBOTS,
    "RECENT": course.RECENT,
    "RECENT_SHARE": course.RECENT_SHARE,
    "CLEARED": course.CLEARED,
    "ONE_KIND": changed_regions.ONE_KIND,
    "IN_USE_DAYS": in_use.DAYS,
    "MOST_PICKS": picks.MOST,
    "STEP_LOGS": LEAST_LOGS,
    "STOP_S": picks.STOP_S,
    "CHANGED_SHARE": picks.CHANGED_SHARE,
    "UNREADABLE_S": picks.UNREADABLE_S,
    "DOUBTFUL_S": picks.DOUBTFUL_S,
    "GATE_S": picks.GATE_S,
    "SURE": picks.SURE,
}


@dataclass(frozen=True)
class Query:
    """One question.

    Attributes:
        name: short, for a link or a file.
        question: in words.
        sql: one statement of DuckDB's dialect, after `views()`, in the batch's folder.
    """

    name: str
    question: str
    sql: str


def views() -> str:
    """The statements that every query needs first: rows that count, each log once.

    What they count is worked out once, so that all answers are of the same moment.
    """
    tables = "\n".join(_text("table", TABLE=name) for name in TABLES)
    return _text("views", TABLES=tables)


def queries() -> tuple[Query, ...]:
    """All questions, in the order of the fleet page."""
    return tuple(_queries())


def _queries() -> Iterator[Query]:
    for column in DIMENSIONS:
        yield Query(
            f"verdicts_by_{column}",
            f"How do logs fare by {_WORDS.get(column, column)}?",
            # Of one robot is asked how it fares itself: its logs count in full.
            _text(
                "verdicts",
                COLUMN=column,
                CORRELATION="0.0" if column == "robot" else "correlation",
            ),
        )
    for name, question in (
        ("causes", "What makes robots fail, and what does it cost?"),
        ("spots", "Where do robots get lost?"),
        ("areas", "Which aisles need to be mapped again?"),
        ("picks", "Which logs are worth looking at first?"),
        ("steps", "What became worse from one software version to the next?"),
        ("maps", "What happened at each place of each map?"),
        ("failures", "Which logs could not be judged?"),
        ("copies", "Which logs are there under several names?"),
    ):
        yield Query(name, question, _text(name))


def queries_sql(folder: Path) -> str:
    """The text of `queries.sql` for a batch's folder.

    Args:
        folder: of the batch; its name stands in the head.
    """
    name = " ".join(folder.name.split())
    head = (
        f"-- The tables of {name or 'this folder'}, asked. Run it in this folder:\n"
        '--   duckdb -c ".read queries.sql"\n'
        "-- Intervals of rates per km and h are on the page: they need quantiles that SQL lacks.\n"
    )
    asked = (f"-- {query.name}: {query.question}\n{query.sql}" for query in queries())
    return "\n".join([head, views(), *asked])


def _text(name: str, **values: object) -> str:
    text = files("slamreplay.fleet").joinpath("sql", f"{name}.sql").read_text(encoding="utf-8")
    return Template(text).substitute({**_VALUES, **values})
