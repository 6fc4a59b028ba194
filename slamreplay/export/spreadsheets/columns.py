"""A table's columns as columns of single numbers or texts, each with unit, frame and meaning."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from slamreplay.bundle.arrow import numbers_to_arrow, texts_to_arrow
from slamreplay.bundle.schema import Column
from slamreplay.bundle.tables import Ragged, Table
from slamreplay.geometry.times import NO_STAMP

#: How the last part of a vector column's name tells its entries.
_ENTRIES = {
    "xyz": ("x", "y", "z"),
    "xyzw": ("x", "y", "z", "w"),
    "xyyaw": ("x", "y", "yaw"),
}
#: Axes of square matrices by their number of entries.
_AXES = {9: ("x", "y", "z"), 36: ("x", "y", "z", "rx", "ry", "rz")}
#: A spreadsheet computes a cell that begins so (OWASP, "CSV Injection"); an apostrophe before it
#: makes it a text.
_COMPUTED = ("=", "+", "-", "@", "\t", "\r", "\n")


@dataclass(frozen=True, eq=False)
class Cells:
    """One column of a CSV file.

    Attributes:
        name: its header.
        values: (N,) as Arrow writes them; null is an empty cell.
        unit: of its numbers.
        frame: that they are in.
        doc: what they are.
    """

    name: str
    values: pa.Array
    unit: str = ""
    frame: str = ""
    doc: str = ""


def cells_of(table: Table) -> list[Cells]:
    """All columns of a table: vectors and matrices entry by entry, lists in one cell each."""
    return [cells for column in table.schema.columns for cells in _cells(column, table)]


def numbers(name: str, values: Any, unit: str = "", doc: str = "", frame: str = "") -> Cells:
    """A column of numbers (N,); NaN is an empty cell."""
    array = np.asarray(values)
    if array.dtype.kind == "f":
        return Cells(name, _floats(array.astype(np.float64)), unit, frame, doc)
    return Cells(name, pa.array(array), unit, frame, doc)


def texts(name: str, values: Any, doc: str = "") -> Cells:
    """A column of texts (N,), none of which a spreadsheet takes for a formula."""
    safe = [f"'{v}" if str(v).startswith(_COMPUTED) else str(v) for v in values]
    return Cells(name, pa.array(safe, type=pa.string()), doc=doc)


def _cells(column: Column, table: Table) -> Iterator[Cells]:
    data: Any = table[column.name]
    told = {"unit": column.unit, "frame": column.frame, "doc": column.doc}
    if isinstance(data, Ragged):
        doc = f"{column.doc}; numbers with a space between".lstrip("; ")
        yield Cells(column.name, _lists(data), column.unit, column.frame, doc)
    elif column.size:
        units = column.unit.split(", ") if column.name.endswith("xyyaw") else [column.unit]
        for k, name in enumerate(_names(column)):
            unit = units[min(k, len(units) - 1)]
            yield Cells(name, _floats(data[:, k]), unit, column.frame, column.doc)
    elif column.kind == "str":
        yield texts(column.name, data, column.doc)
    elif column.name == "t_sensor_ns":
        yield Cells(column.name, numbers_to_arrow(data, pa.int64(), data != NO_STAMP), **told)
    elif column.kind == "float64":
        yield Cells(column.name, _floats(data), **told)
    else:
        yield Cells(column.name, pa.array(data), **told)


def _names(column: Column) -> list[str]:
    stem, _, letters = column.name.rpartition("_")
    if letters in _ENTRIES:
        return [f"{stem}_{entry}" for entry in _ENTRIES[letters]]
    axes = _AXES[column.size]
    return [f"{column.name}_{a}_{b}" for a, b in product(axes, axes)]


def _floats(values: NDArray[np.float64]) -> pa.Array:
    return pa.array(np.ascontiguousarray(values), from_pandas=True)


def _lists(rows: Ragged) -> pa.Array:
    """Numbers of each row in one cell, in the fewest digits that give them back."""
    words = rows.values.astype(str)
    found = [" ".join(words[a:b]) for a, b in pairwise(rows.offsets.tolist())]
    return texts_to_arrow(np.array([*found, ""], dtype=object)[:-1])
