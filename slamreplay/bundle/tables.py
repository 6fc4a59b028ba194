"""A table in memory: numpy columns under a schema, and its way to Parquet and back."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from slamreplay.bundle.arrow import (
    nulls_from_arrow,
    numbers_from_arrow,
    numbers_to_arrow,
    texts_from_arrow,
    texts_to_arrow,
)
from slamreplay.bundle.schema import Column, TableSchema
from slamreplay.errors import BundleError
from slamreplay.geometry.times import NO_STAMP

if TYPE_CHECKING:
    import pandas as pd

#: Bytes of a row group: what is held at once while a large table is written or read.
GROUP_BYTES = 32_000_000

_DTYPES: dict[str, Any] = {
    "int64": np.int64,
    "int32": np.int32,
    "int8": np.int8,
    "float64": np.float64,
}
_DTYPES |= {"bool": np.bool_, "list_f32": np.float32, "list_f64": np.float64, "list_i8": np.int8}


@dataclass(frozen=True, eq=False)
class Ragged:
    """N sequences of different length: row i is `values[offsets[i]:offsets[i + 1]]`."""

    values: NDArray[Any]
    offsets: NDArray[np.int64]

    @classmethod
    def of(cls, rows: Iterable[Any], dtype: Any) -> Ragged:
        """From any sequences of numbers."""
        arrays = [np.asarray(row, dtype=dtype).ravel() for row in rows]
        lengths = np.array([len(a) for a in arrays], dtype=np.int64)
        values = np.concatenate(arrays) if arrays else np.empty(0, dtype=dtype)
        return cls(values, np.concatenate([[0], np.cumsum(lengths)]))

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def __getitem__(self, row: int) -> NDArray[Any]:
        return self.values[self.offsets[row] : self.offsets[row + 1]]

    @property
    def nbytes(self) -> int:
        """Bytes in memory."""
        return int(self.values.nbytes + self.offsets.nbytes)

    @property
    def lengths(self) -> NDArray[np.int64]:
        """(N,) entries in each row."""
        return np.diff(self.offsets)

    def rows(self, first: int, last: int) -> Ragged:
        """The rows from `first` up to `last`, without a copy."""
        begin, end = self.offsets[first], self.offsets[last]
        return Ragged(self.values[begin:end], self.offsets[first : last + 1] - begin)

    def spread(self, numbers: NDArray[Any]) -> NDArray[Any]:
        """One number a row (N,) as one an entry; a single one where all rows have the same."""
        if len(numbers) and bool((numbers == numbers[0]).all()):
            return numbers[:1]
        return np.repeat(numbers, self.lengths)

    def take(self, index: NDArray[np.int64]) -> Ragged:
        """The rows at `index`, in that order."""
        lengths = self.lengths
        if len(lengths) and bool((lengths == lengths[0]).all()):
            # An index of every entry would be several times as large as the entries.
            width, first = int(lengths[0]), int(self.offsets[0])
            rows = self.values[first : first + width * len(lengths)].reshape(len(lengths), width)
            return Ragged(rows[index].ravel(), np.arange(len(index) + 1, dtype=np.int64) * width)
        lengths = lengths[index]
        offsets = np.concatenate([[0], np.cumsum(lengths)])
        entry = np.arange(offsets[-1]) - np.repeat(offsets[:-1] - self.offsets[index], lengths)
        return Ragged(self.values[entry], offsets)


ColumnData = NDArray[Any] | Ragged


def group_bounds(rows: int, size: int) -> Iterator[range]:
    """Ranges of rows of about `GROUP_BYTES`, of `size` bytes in all; one range at least."""
    step = max(rows * GROUP_BYTES // max(size, 1), 1)
    for start in range(0, max(rows, 1), step):
        yield range(start, min(start + step, rows))


def concatenated(columns: Sequence[Any]) -> Any:
    """Columns of one kind, one after the other; a single one as it is."""
    if len(columns) == 1:
        return columns[0]
    if not isinstance(columns[0], Ragged):
        return np.concatenate(columns)
    offsets = np.concatenate([[0], np.cumsum(np.concatenate([c.lengths for c in columns]))])
    values = [c.values[c.offsets[0] : c.offsets[-1]] for c in columns]
    return Ragged(np.concatenate(values), offsets.astype(np.int64))


class Table:
    """Columns by name, checked against a schema and read-only.

    Args:
        schema: what the columns must be.
        columns: numpy array (N,) or (N, size), `Ragged` for lists, object array of str for text.

    Raises:
        BundleError: a column is missing, unknown, or of the wrong shape or length.
    """

    def __init__(self, schema: TableSchema, columns: Mapping[str, Any]) -> None:
        self.schema = schema
        names = [c.name for c in schema.columns]
        if set(columns) != set(names):
            odd = sorted(set(columns) ^ set(names))
            raise BundleError(f"columns do not fit the schema: {odd}", where=schema.name)
        self._columns = {c.name: _checked(c, columns[c.name], schema.name) for c in schema.columns}
        lengths = {len(data) for data in self._columns.values()}
        if len(lengths) > 1:
            raise BundleError(
                f"columns have different lengths {sorted(lengths)}", where=schema.name
            )

    @classmethod
    def empty(cls, schema: TableSchema) -> Table:
        """A table without rows."""
        return cls(schema, {c.name: [] for c in schema.columns})

    def __len__(self) -> int:
        return len(self._columns["t_ns"])

    def __getitem__(self, name: str) -> Any:
        """The column as numpy array or `Ragged`."""
        return self._columns[name]

    @property
    def t_ns(self) -> NDArray[np.int64]:
        """(N,) times on the bundle's clock."""
        return np.asarray(self._columns["t_ns"])

    def take(self, index: Any) -> Table:
        """The rows at an index array, or where a mask (N,) is true."""
        index = np.asarray(index)
        index = np.flatnonzero(index) if index.dtype == bool else index.astype(np.int64)
        return Table(
            self.schema,
            {
                name: data.take(index) if isinstance(data, Ragged) else data[index]
                for name, data in self._columns.items()
            },
        )

    def replace(self, **columns: Any) -> Table:
        """A copy with some columns exchanged."""
        return Table(self.schema, {**self._columns, **columns})

    def sorted_by_time(self) -> Table:
        """Rows ordered by `t_ns`, then by log time; equal rows keep their order."""
        steps, log_steps = np.diff(self.t_ns), np.diff(self["t_log_ns"])
        if bool(((steps > 0) | ((steps == 0) & (log_steps >= 0))).all()):
            return self
        return self.take(np.lexsort((self["t_log_ns"], self.t_ns)))

    def groups(self) -> Iterator[Table]:
        """The rows in parts of `GROUP_BYTES`, which are the row groups of the Parquet file."""
        size = sum(data.nbytes for data in self._columns.values())
        for rows in group_bounds(len(self), size):
            yield self if len(rows) == len(self) else self.take(np.arange(rows.start, rows.stop))

    def to_arrow(self) -> pa.Table:
        """The Parquet form."""
        arrays = [_to_arrow(c, self._columns[c.name]) for c in self.schema.columns]
        return pa.Table.from_arrays(arrays, schema=self.schema.arrow_schema)

    @classmethod
    def from_arrow(cls, schema: TableSchema, table: pa.Table) -> Table:
        """From a Parquet file's table.

        Raises:
            BundleError: it does not have the schema's columns.
        """
        if set(table.column_names) != {c.name for c in schema.columns}:
            raise BundleError("Parquet columns do not fit the schema", where=schema.name)
        return cls(schema, {c.name: _from_arrow(c, table[c.name]) for c in schema.columns})

    def to_pandas(self) -> pd.DataFrame:
        """A DataFrame; vectors are columns of arrays."""
        return self.to_arrow().to_pandas()

    @classmethod
    def concat(cls, schema: TableSchema, tables: Iterable[Table]) -> Table:
        """All rows, one table after the other."""
        parts = list(tables)
        if len(parts) < 2:
            return parts[0] if parts else cls.empty(schema)
        return cls(
            schema, {c.name: concatenated([t[c.name] for t in parts]) for c in schema.columns}
        )


def _checked(column: Column, data: Any, table: str) -> ColumnData:
    if column.kind.startswith("list_"):
        dtype = _DTYPES[column.kind]
        if not isinstance(data, Ragged):
            return Ragged.of(data, dtype)
        return Ragged(np.asarray(data.values, dtype=dtype), np.asarray(data.offsets, np.int64))
    if column.kind == "str":
        array = np.asarray(data, dtype=object)
    else:
        array = np.asarray(data, dtype=_DTYPES[column.kind])
    if not len(array):
        array = array.reshape((0, column.size) if column.size else (0,))
    expected = (len(array), column.size) if column.size else (len(array),)
    if array.shape != expected:
        raise BundleError(
            f"column '{column.name}' has shape {array.shape}, expected {expected}", where=table
        )
    own = array.view()  # the caller's array stays as writable as it was
    own.setflags(write=False)
    return own


def _to_arrow(column: Column, data: ColumnData) -> pa.Array:
    kind = column.arrow_type
    if isinstance(data, Ragged):
        values = numbers_to_arrow(data.values, kind.value_type)
        offsets = numbers_to_arrow(data.offsets.astype(np.int32), pa.int32())
        return pa.ListArray.from_arrays(offsets, values)
    if column.size:
        flat = numbers_to_arrow(np.ascontiguousarray(data).ravel(), kind.value_type)
        return pa.FixedSizeListArray.from_arrays(flat, column.size)
    if column.kind == "str":
        return texts_to_arrow(data)
    valid = data != NO_STAMP if column.name == "t_sensor_ns" else None
    return numbers_to_arrow(data, kind, valid)


def _from_arrow(column: Column, chunked: pa.ChunkedArray) -> ColumnData:
    array = chunked.combine_chunks()
    if isinstance(array, pa.ChunkedArray):
        array = pa.concat_arrays(array.chunks) if array.num_chunks else pa.array([], array.type)
    if column.kind == "str":
        return texts_from_arrow(array)
    dtype = _DTYPES[column.kind]
    if column.kind.startswith("list_"):
        offsets = numbers_from_arrow(array.offsets, np.int32).astype(np.int64)
        values = numbers_from_arrow(array.values, dtype)[offsets[0] : offsets[-1]]
        return Ragged(values, offsets - offsets[0])
    if column.size:
        return numbers_from_arrow(array.flatten(), dtype).reshape((-1, column.size))
    values = numbers_from_arrow(array, dtype)
    if column.name == "t_sensor_ns" and array.null_count:
        return np.where(nulls_from_arrow(array), NO_STAMP, values)
    return values
