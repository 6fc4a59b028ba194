"""Parts of tables on disk: each is there as a whole or not at all."""

from __future__ import annotations

import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from slamreplay.bundle.atomic import atomic_folder
from slamreplay.fleet.schema import arrow_schema

if TYPE_CHECKING:
    import pyarrow as pa

TABLES_FOLDER = "tables"


def commit(folder: Path, tables: Mapping[str, pa.Table]) -> None:
    """Append rows."""
    import pyarrow.parquet as pq

    part = folder / TABLES_FOLDER / f"{len(_parts(folder)):08d}-{uuid.uuid4().hex[:8]}"
    with atomic_folder(part, marker="logs.parquet") as work:
        for name, table in tables.items():
            pq.write_table(table, work / f"{name}.parquet")


def committed_keys(folder: Path) -> set[str]:
    """Keys of the logs that are there."""
    return set(read(folder, "logs").column("key").to_pylist())


def read(folder: Path, table: str) -> pa.Table:
    """The rows of a table."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    files = [part / f"{table}.parquet" for part in _parts(folder)]
    tables = [pq.ParquetFile(file).read() for file in files if file.exists()]
    return pa.concat_tables([arrow_schema(table).empty_table(), *tables])


def compact(folder: Path) -> None:
    """Make small parts one."""


def _parts(folder: Path) -> list[Path]:
    return sorted((folder / TABLES_FOLDER).glob("[!.]*"))
