"""Parts of a folder of tables: `tables/<part>/<table>.parquet`, each whole or absent.

A part is written once and never changed. Its name tells its place in time, how often its rows were
laid together, and how many logs it has; of two parts with the same log the later name counts.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from slamreplay.errors import OutputError
from slamreplay.fleet.schema import TABLES, arrow_schema

if TYPE_CHECKING:
    import pyarrow as pa

FOLDER = "tables"
#: Beside it, so that no pattern over its folders meets what is not finished yet.
UNFINISHED = ".unfinished"
#: Rows of a row group: what is in memory at a time.
ROWS = 1 << 17

_NAME = re.compile(r"(\d{8})-(\d{3})-(\d{7})-[0-9a-f]{8}")


@dataclass(frozen=True)
class Part:
    """One part.

    Attributes:
        folder: where it lies.
        number: of its newest rows, ascending in time.
        joined: how often its rows were laid together with others.
        logs: rows of its table `logs`.
    """

    folder: Path
    number: int
    joined: int
    logs: int

    def file(self, table: str) -> Path:
        """The file of a table."""
        return self.folder / f"{table}.parquet"


def parts_in(folder: Path) -> list[Part]:
    """All parts of a batch's folder, in the order in which later ones count."""
    try:
        names = sorted(os.listdir(folder / FOLDER))  # noqa: PTH208 - no Path each
    except (FileNotFoundError, NotADirectoryError):
        return []
    found = ((name, _NAME.fullmatch(name)) for name in names)
    return [
        Part(folder / FOLDER / name, *(int(number) for number in fit.groups()))
        for name, fit in found
        if fit
    ]


def write_part(
    folder: Path,
    tables: Mapping[str, Iterable[pa.Table]],
    logs: int,
    number: int,
    joined: int = 0,
) -> Part:
    """Write a part and let it appear by one rename; the same rows give the same bytes and name.

    Args:
        folder: of the batch.
        tables: rows by table, as many at a time as are at hand; tables that are not given are
            written without rows, so that patterns over files find each of them.
        logs: how many it has.
        number: as of `Part`.
        joined: likewise.

    Raises:
        OutputError: the folder takes no part.
    """
    try:
        (folder / UNFINISHED).mkdir(parents=True, exist_ok=True)
        (folder / FOLDER).mkdir(exist_ok=True)
        work = Path(tempfile.mkdtemp(dir=folder / UNFINISHED))
        try:
            work.chmod(0o755)
            digest = hashlib.sha256()
            for table in sorted({*TABLES, *tables}):
                _write(work / f"{table}.parquet", table, tables.get(table, ()), digest)
            name = f"{number:08d}-{joined:03d}-{logs:07d}-{digest.hexdigest()[:8]}"
            target = folder / FOLDER / name
            _appear(work, target)
        finally:
            shutil.rmtree(work, ignore_errors=True)
    except OSError as error:
        raise OutputError(f"cannot write: {error.strerror or error}", where=folder) from error
    return Part(target, number, joined, logs)


def _write(file: Path, table: str, rows: Iterable[pa.Table], digest: hashlib._Hash) -> None:
    import pyarrow.parquet as pq

    with file.open("w+b") as stream:
        grouped = _grouped(table, rows)
        first = next(grouped)
        # A flipped bit is told, not read, by what checks the sums of pages.
        with pq.ParquetWriter(
            stream, first.schema, compression="zstd", write_page_checksum=True
        ) as writer:
            writer.write_table(first)
            for group in grouped:
                writer.write_table(group)
        stream.flush()
        os.fsync(stream.fileno())  # before the rename, which may outrun the content
        stream.seek(0)
        digest.update(f"{table} {hashlib.file_digest(stream, 'sha256').hexdigest()}\n".encode())


def _grouped(table: str, rows: Iterable[pa.Table]) -> Iterator[pa.Table]:
    """Row groups of a size, at least one: the bytes must not tell how the rows came along."""
    import pyarrow as pa

    held = arrow_schema(table).empty_table()
    is_first = True
    for some in rows:
        held = pa.concat_tables([held, some], promote_options="permissive").combine_chunks()
        while held.num_rows >= ROWS:
            yield held.slice(0, ROWS)
            held, is_first = held.slice(ROWS), False
    if held.num_rows or is_first:
        yield held


def _appear(work: Path, target: Path) -> None:
    try:
        work.rename(target)
    except OSError:
        if not target.is_dir():
            raise
        # The name holds a hash: somebody else wrote the same rows.
    with suppress(OSError):  # some file systems know no such thing of folders
        handle = os.open(target.parent, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def remove_part(folder: Path, part: Part) -> None:
    """Take a part out of sight in one step, then away; one that is gone already is no fault."""
    try:
        (folder / UNFINISHED).mkdir(exist_ok=True)
        work = Path(tempfile.mkdtemp(dir=folder / UNFINISHED))
        with suppress(FileNotFoundError):
            part.folder.rename(work / part.folder.name)
        shutil.rmtree(work, ignore_errors=True)
    except OSError as error:
        raise OutputError(f"cannot remove: {error.strerror or error}", where=folder) from error
