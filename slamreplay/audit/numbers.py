"""Placeholders and numbers that are none, counted by topic and column as they were recorded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from slamreplay.bundle import placeholders
from slamreplay.bundle.covariance_faults import NOT_FINITE, NOT_GIVEN
from slamreplay.bundle.tables import Table

#: Columns in which a number that is none is a fault: NaN stands for "not given" elsewhere.
_MEASURED = {
    "odometry": ("linear_velocity_xyz", "angular_velocity_xyz"),
    "commands": ("linear_velocity_xyz", "angular_velocity_xyz"),
    "imu": ("orientation_xyzw", "angular_velocity_xyz", "linear_acceleration_xyz"),
}


@dataclass(frozen=True)
class OddNumbers:
    """Rows of one topic's column with one fault.

    Attributes:
        topic: whose they are.
        table: where they stand.
        column: which one.
        fault: a text of `slamreplay.bundle.placeholders`.
        rows: how many rows have it; of `n`.
        start_ns: the first of them, end_ns: the last, on the bundle's clock.
    """

    topic: str
    table: str
    column: str
    fault: str
    rows: int
    n: int
    start_ns: int
    end_ns: int


def odd_numbers(read: Callable[[str], Table], map_frame: str | None) -> list[OddNumbers]:
    """What is odd, table by table.

    Args:
        read: gives a table as it was recorded.
        map_frame: the frame in which a pose's uncertainty need not grow.
    """
    found = []
    for name in dict.fromkeys([*placeholders.COLUMNS, *_MEASURED]):
        table = read(name)
        for topic in dict.fromkeys(table["topic"]):
            rows = table.take(table["topic"] == topic)
            found += _of_topic(rows, str(topic), map_frame)
    return found


def _of_topic(rows: Table, topic: str, map_frame: str | None) -> list[OddNumbers]:
    name, found = rows.schema.name, []
    faults = [
        (column, fault, mask)
        for column in placeholders.COLUMNS.get(name, ())
        for fault, mask in placeholders.judge(rows, column, map_frame).faults.items()
    ]
    for column in _MEASURED.get(name, ()):
        none = ~np.isfinite(rows[column]).all(axis=1)
        # ingest has NaN for what an Imu marks as not measured.
        # A column without any number was not measured either: text logs, steered wheels.
        fault = NOT_GIVEN if name == "imu" or none.all() else NOT_FINITE
        faults.append((column, fault, none))
    for column, fault, mask in faults:
        if mask.any():
            t = rows.t_ns[mask]
            count = int(mask.sum())
            found.append(
                OddNumbers(topic, name, column, fault, count, len(rows), int(t.min()), int(t.max()))
            )
    return found
