"""rosbag2's SQLite storage (.db3), read with the standard library, whatever its schema version."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager
from itertools import accumulate, islice
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from slamreplay.bundle.manifest import Loss, Source
from slamreplay.errors import LogError
from slamreplay.ingest.readers.reader import WINDOW_BYTES, Block, Connection, normalise_type
from slamreplay.ingest.readers.sqlite.salvage import Salvaged, salvage

MAGIC = b"SQLite format 3\0"
_FORMATS = {"ros2msg": "msg", "ros2idl": "idl"}
_ROWS = 1000
#: Number of the message, number of its topic, log time in ns, payload.
_Row = tuple[int, int, int, bytes]


class SqliteReader:
    """One .db3 file; it is never written to, not even where a write-ahead log lies beside it.

    Raises:
        LogError: not a rosbag2 database, or a damaged one.
    """

    def __init__(self, path: Path, source: Source) -> None:
        self.sources = (source,)
        self.losses: list[Loss] = []
        self._path = path
        self._salvaged: Salvaged | None = None
        try:
            _check_size(path)
            with self._database() as database:
                # SQLite reads on over some damage, and gives fewer messages or some twice.
                (verdict,) = database.execute("PRAGMA quick_check(1)").fetchone()
                if verdict != "ok":
                    raise sqlite3.DatabaseError(verdict)
                tables = {r[0] for r in database.execute("SELECT name FROM sqlite_master")}
                if not {"topics", "messages"} <= tables:
                    raise LogError("a SQLite file, but not of rosbag2", where=path)
                topics = database.execute(
                    "SELECT id, name, type, serialization_format FROM topics ORDER BY id"
                ).fetchall()
                texts = {}
                if "message_definitions" in tables:
                    rows = database.execute(
                        "SELECT topic_type, encoding, encoded_message_definition"
                        " FROM message_definitions"
                    )
                    texts = {r[0]: (r[1], r[2]) for r in rows if r[1] in _FORMATS and r[2]}
                counts = self._counts(database)
                if not all(isinstance(text, str) for topic in topics for text in topic[1:]):
                    raise sqlite3.DatabaseError("a topic without a name")
        except (sqlite3.Error, UnicodeDecodeError) as error:
            self._salvaged = salvaged = salvage(path)
            topics, texts, counts = salvaged.topics, salvaged.definitions, dict(salvaged.counts)
            if not topics:
                raise LogError(f"damaged SQLite file: {error}", where=path) from error
        self._indices = {row[0]: index for index, row in enumerate(topics)}
        self._unnamed = sum(n for number, n in counts.items() if number not in self._indices)
        self.connections = tuple(
            Connection(
                index,
                name,
                normalise_type(kind),
                encoding,
                texts.get(kind, ("", ""))[1],
                _FORMATS.get(texts.get(kind, ("", ""))[0], ""),
                counts.get(number, 0),
            )
            for index, (number, name, kind, encoding) in enumerate(topics)
        )

    def blocks(self, wanted: Collection[int]) -> Iterator[Block]:
        """See `Reader`."""
        self.losses.clear()
        numbers = [number for number, index in self._indices.items() if index in wanted]
        window: list[_Row] = []
        size = read = 0
        for rows in self._rows(numbers):
            window += rows
            read += len(rows)
            size += sum(len(row[3]) for row in rows)
            if size > WINDOW_BYTES:
                yield self._block(window)
                window, size = [], 0
        if window:
            yield self._block(window)
        missing = sum(self.connections[index].count for index in wanted) - read
        if self._salvaged is None and not self.losses:  # salvage tells of these itself
            self._lose(missing, "rows that hold no message")
            self._lose(self._unnamed, "the row that names their topic is gone")

    def _lose(self, count: int, reason: str) -> None:
        if count > 0:
            what = f"{self._path.name}: messages"
            self.losses.append(Loss(kind="lost", what=what, count=count, reason=reason))

    def _rows(self, numbers: list[int]) -> Iterator[list[_Row]]:
        """Messages of some topics, a thousand at a time; by the pages where SQLite gives up."""
        last = None
        salvaged = self._salvaged
        if salvaged is None:
            try:
                with self._database() as database:
                    cursor = database.execute(
                        "SELECT id, topic_id, timestamp, data FROM messages"  # noqa: S608 - marks
                        f" WHERE topic_id IN ({', '.join('?' * len(numbers))})"
                        " AND typeof(timestamp) = 'integer' AND typeof(data) = 'blob' ORDER BY id",
                        numbers,
                    )
                    while found := cursor.fetchmany(_ROWS):
                        last = found[-1][0]
                        yield found
            except (sqlite3.Error, UnicodeDecodeError):
                salvaged = salvage(self._path)
            else:
                return
        rest = ((0, *row) for row in salvaged.messages(after=last) if row[0] in numbers)
        while found := list(islice(rest, _ROWS)):
            yield found
        self.losses += salvaged.losses(self._path.name)

    def _block(self, rows: list[_Row]) -> Block:
        _, numbers, times, payloads = zip(*rows, strict=True)
        ends = np.array(list(accumulate(map(len, payloads))), dtype=np.int64)
        return Block(
            np.frombuffer(b"".join(payloads), dtype=np.uint8),
            np.array([self._indices[number] for number in numbers], dtype=np.int64),
            np.concatenate([[0], ends[:-1]]),
            ends,
            np.array(times, dtype=np.int64),
        )

    def _counts(self, database: sqlite3.Connection) -> dict[int, int]:
        rows = database.execute("SELECT topic_id, COUNT(*) FROM messages GROUP BY topic_id")
        return dict(rows.fetchall())

    @contextmanager
    def _database(self) -> Iterator[sqlite3.Connection]:
        """The database, opened so that nothing beside it is created or changed."""
        log = self._path.with_name(self._path.name + "-wal")
        if not (log.exists() and log.stat().st_size):
            uri = f"{self._path.resolve().as_uri()}?mode=ro&immutable=1"
            with closing(sqlite3.connect(uri, uri=True)) as database:
                database.text_factory = _text
                yield database
            return
        # Its newest messages are in the write-ahead log, which SQLite would fold into the file.
        with TemporaryDirectory(prefix="slamreplay-") as folder:
            for file in (self._path, log):
                shutil.copy(file, folder)
            with closing(sqlite3.connect(Path(folder) / self._path.name)) as database:
                database.text_factory = _text
                yield database


def _text(data: bytes) -> str:
    return data.decode("utf-8", "replace")


def _check_size(path: Path) -> None:
    """Raise sqlite3.DatabaseError where the file is shorter than its header says.

    SQLite takes the pages that are missing for empty ones as long as it may. The header's count of
    pages holds where it was written with the last change (sqlite.org/fileformat.html, 1.3.7).
    """
    with path.open("rb") as stream:
        head = stream.read(100)
    if len(head) < 100:
        raise sqlite3.DatabaseError("the file ends within its header")
    page, changes, pages, valid_for = (
        int.from_bytes(head[a:b], "big") for a, b in ((16, 18), (24, 28), (28, 32), (92, 96))
    )
    size = (65536 if page == 1 else page) * pages
    if changes == valid_for and path.stat().st_size < size:
        raise sqlite3.DatabaseError("the file is cut")
