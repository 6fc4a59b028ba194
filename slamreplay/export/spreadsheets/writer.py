"""A folder of CSV files: `tables/`, `answers/`, columns.json and a word on how to read them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.csv

from slamreplay.bundle.schema import TABLES
from slamreplay.errors import UsageError
from slamreplay.export.request import Request
from slamreplay.export.spreadsheets.answers import answers
from slamreplay.export.spreadsheets.columns import Cells, cells_of

_README = """\
tables/   what was recorded, a file for each table of the bundle that has rows
answers/  what was found; t_ns is the same clock in every file
columns.json  of each file and column: unit, frame and meaning

Times are whole nanoseconds: read them as 64-bit integers, for a float loses the last digits.
An empty cell is a number that is not known. Where a column of times has empty cells, pandas needs
dtype={"t_sensor_ns": "Int64"} to keep the digits. inf and -inf are ranges as recorded (REP-117).
Vectors are columns _x _y _z (_w), covariances of poses columns _x_x to _rz_rz, row by row, order
x y z rx ry rz, fixed axes of the frame. A list of numbers stands in one cell, with spaces between.
A text that begins with = + - @, a tab or a line's end has an apostrophe before it: a spreadsheet
would compute it.
"""


def write_csv(request: Request, folder: Path) -> None:
    """Write the files of a request.

    Raises:
        UsageError: there is no row to write.
    """
    columns: dict[str, list[dict[str, str]]] = {}
    if request.recorded:
        for k, name in enumerate(TABLES):
            request.say(f"writing {name}", k / len(TABLES))
            table = request.bundle.table(name)
            keep = request.holds(table.t_ns)
            if name == "transforms":
                keep |= table["is_static"]
            if keep.any():
                file = f"tables/{name}.csv"
                columns[file] = _write(folder / file, cells_of(table.take(keep)))
    if request.post is not None:
        for name, cells in answers(request, request.post).items():
            file = f"answers/{name}.csv"
            columns[file] = _write(folder / file, cells)
    if not columns:
        raise UsageError("nothing was recorded between --start and --end")
    text = json.dumps(columns, indent=1)
    (folder / "columns.json").write_text(text + "\n", encoding="utf-8")
    (folder / "README.txt").write_text(_README, encoding="utf-8")


def _write(path: Path, cells: Sequence[Cells]) -> list[dict[str, str]]:
    path.parent.mkdir(exist_ok=True)
    table = pa.table({c.name: c.values for c in cells})
    pyarrow.csv.write_csv(table, path, pyarrow.csv.WriteOptions(quoting_style="needed"))
    return [{"name": c.name, "unit": c.unit, "frame": c.frame, "doc": c.doc} for c in cells]
