"""The parts of a folder at one moment, and which of their rows count."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from slamreplay.fleet.damage import DamagedError, Warn, check_part, quiet
from slamreplay.fleet.parts import ROWS, Part, parts_in
from slamreplay.fleet.schema import TABLES, arrow_schema

if TYPE_CHECKING:
    import pyarrow as pa

#: Parts vanish when they are laid together: then one looks again, so often.
_LOOKS = 5

_T = TypeVar("_T")


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Sound parts, and the keys that each of them has the newest rows of.

    Attributes:
        parts: those that can be read, later ones count.
        heads: key and status of their logs, those that a later part has left out.
        stale: of each part, the keys that a later one has, too.
        warn: told of files that turn out to be damaged.
    """

    parts: tuple[Part, ...]
    heads: tuple[pa.Table, ...]
    stale: tuple[pa.Array, ...]
    warn: Warn

    def tables(
        self, table: str, columns: Sequence[str] | None = None, *, coded: bool = False
    ) -> Iterator[pa.Table]:
        """The rows that count, part by part; columns that an older part lacks are null.

        Args:
            table: its name.
            columns: as of `read_part`.
            coded: likewise.

        Raises:
            FileNotFoundError: a part is gone: the snapshot is too old.
        """
        for part, stale in zip(self.parts, self.stale, strict=True):
            try:
                for found in read_part(part, table, columns, coded=coded):
                    yield without(found, stale)
            except DamagedError as error:
                self.warn(f"{error}; left out")


def of_now(folder: Path, use: Callable[[Snapshot], _T], warn: Warn | None = None) -> _T:
    """What `use` makes of the parts; asked anew where parts vanish meanwhile.

    Args:
        folder: of the batch.
        use: reads what it needs.
        warn: told of each damaged part, in one line.
    """
    warn = warn or quiet
    for _ in range(_LOOKS - 1):
        try:
            return use(_snapshot(folder, warn))
        except FileNotFoundError:
            continue
    return use(_snapshot(folder, warn))


def _snapshot(folder: Path, warn: Warn) -> Snapshot:
    import pyarrow as pa

    parts, heads = [], []
    for part in parts_in(folder):
        try:
            check_part(part)
            heads.append(pa.concat_tables(read_part(part, "logs", ("key", "status"))))
        except DamagedError as error:
            if not part.folder.exists():
                raise FileNotFoundError(part.folder) from error
            warn(f"{error}; left out")
        else:
            parts.append(part)
    stale = _stale(heads)
    kept = tuple(without(table, keys) for table, keys in zip(heads, stale, strict=True))
    return Snapshot(tuple(parts), kept, stale, warn)


def _stale(heads: Sequence[pa.Table]) -> tuple[pa.Array, ...]:
    """Of each part, the keys whose newest rows are elsewhere."""
    import pyarrow as pa

    if not heads:
        return ()
    keys = pa.chunked_array([c for table in heads for c in table["key"].chunks], type=pa.string())
    coded = keys.combine_chunks().dictionary_encode()
    code = coded.indices.to_numpy(zero_copy_only=False)
    part = np.repeat(np.arange(len(heads)), [table.num_rows for table in heads])
    last = np.zeros(len(coded.dictionary), dtype=np.int64)
    np.maximum.at(last, code, part)
    old = np.flatnonzero(last[code] != part)
    return tuple(
        coded.dictionary.take(pa.array(code[old[part[old] == k]])) for k in range(len(heads))
    )


def without(table: pa.Table, keys: pa.Array) -> pa.Table:
    """The rows of other keys."""
    import pyarrow.compute as pc

    if not len(keys):
        return table
    column = table["key"]
    return table.filter(pc.invert(pc.is_in(column.cast(keys.type), value_set=keys)))


def read_part(
    part: Part, table: str, columns: Sequence[str] | None = None, *, coded: bool = False
) -> Iterator[pa.Table]:
    """A table of a part, at most `ROWS` at a time, with all columns of its schema.

    Args:
        part: which one.
        table: its name.
        columns: those that are wanted, all if None: with ones that only a later version knows.
        coded: texts by number, with a dictionary: a tenth of the memory where they repeat.

    Raises:
        FileNotFoundError: the part is gone.
        DamagedError: its file cannot be read, or not further.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    file = part.file(table)
    try:
        texts = [n for n, (kind, *_) in TABLES[table].items() if coded and kind == "string"]
        with pq.ParquetFile(file, page_checksum_verification=True, read_dictionary=texts) as opened:
            schema = opened.schema_arrow
            wanted = None if columns is None else [c for c in columns if c in schema.names]
            for batch in opened.iter_batches(ROWS, columns=wanted, use_threads=False):
                yield as_schema(pa.Table.from_batches([batch]), table, columns, coded=coded)
            if not opened.metadata.num_rows:
                yield as_schema(schema.empty_table(), table, columns, coded=coded)
    except FileNotFoundError:
        if part.folder.exists():  # of a version that had no such table
            return
        raise
    except (pa.ArrowException, OSError) as error:
        raise DamagedError(file, str(error).splitlines()[0]) from error


def as_schema(
    found: pa.Table, table: str, columns: Sequence[str] | None = None, *, coded: bool = False
) -> pa.Table:
    """The table with the columns of its schema first, null where it lacks them, then its others."""
    import pyarrow as pa

    schema = arrow_schema(table)
    if coded:
        texts = pa.dictionary(pa.int32(), pa.string())
        schema = pa.schema([f.with_type(texts) if f.type == pa.string() else f for f in schema])
    if columns is not None:
        schema = pa.schema([schema.field(name) for name in columns])
    others = [field for field in found.schema if field.name not in schema.names]
    whole = pa.schema([*schema, *others])
    return pa.table(
        [
            found[field.name].cast(field.type)
            if field.name in found.schema.names
            else pa.nulls(found.num_rows, field.type)
            for field in whole
        ],
        schema=whole,
    )
