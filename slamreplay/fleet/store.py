"""The tables of a batch in a folder that grows over days: `DIR/tables/<part>/<table>.parquet`.

What holds at every instant, whoever is killed: a part is there as a whole or not at all; each log
that was committed is in a part; and a reader that takes of each key the rows of the last part by
name, as `read` and the views of `queries.sql` do, has it once. A pattern over all files
(`tables/*/logs.parquet`) misses nothing either, but may meet a log twice: where it was tried again,
and while parts are being laid together. `compaction.compact` ends both.

Readers must choose anyway, for a log that is tried again has an older row; so laying parts together
only adds a part and then takes old ones away. An exchange of the whole folder in one step would
need symbolic links or system calls that not every file system has.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from slamreplay.fleet.compaction import compact, join_small
from slamreplay.fleet.damage import Warn
from slamreplay.fleet.parts import parts_in, write_part
from slamreplay.fleet.snapshot import Snapshot, as_schema, of_now

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["commit", "committed", "compact", "read"]


def commit(folder: Path, tables: Mapping[str, pa.Table], warn: Warn | None = None) -> None:
    """Add the rows of one log or several; rows of the same keys that are there count no longer.

    Now and then it lays small parts together, so that no folder of a hundred thousand comes about.

    Args:
        folder: of the batch.
        tables: by name, `logs` among them; one part has rows of whole logs only.
        warn: told of each damaged part that was met, in one line; it is set aside.

    Raises:
        ValueError: there is no log.
        OutputError: the folder cannot be written.
    """
    if "logs" not in tables or not tables["logs"].num_rows:
        raise ValueError("a part needs a row of logs")
    parts = parts_in(folder)
    number = 1 + max((part.number for part in parts), default=0)
    rows = {name: [table] for name, table in tables.items()}
    parts.append(write_part(folder, rows, tables["logs"].num_rows, number))
    join_small(folder, parts, warn)


def committed(folder: Path, warn: Warn | None = None) -> dict[str, str]:
    """Status (done or failed) by key of all logs that were committed, and can be read.

    Args:
        folder: of the batch; one without tables has none.
        warn: told of each damaged part, in one line: its logs are not among them.
    """

    def look(now: Snapshot) -> dict[str, str]:
        found: dict[str, str] = {}
        for table in now.heads:
            found.update(zip(table["key"].to_pylist(), table["status"].to_pylist(), strict=True))
        return found

    return of_now(folder, look, warn)


def read(folder: Path, table: str, warn: Warn | None = None) -> pa.Table:
    """All rows of a table that count, in the order of their keys, and within one as they were made.

    Args:
        folder: of the batch; one without tables has no rows.
        table: its name in `schema.TABLES`.
        warn: told of each damaged part, in one line.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    def look(now: Snapshot) -> pa.Table:
        empty = as_schema(pa.table({}), table)
        found = [empty, *now.tables(table)]
        whole = pa.concat_tables(found, promote_options="permissive")
        return whole.take(pc.sort_indices(whole["key"]))  # stable

    return of_now(folder, look, warn)
