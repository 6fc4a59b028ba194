"""rosbag2's SQLite storage (.db3), read with the standard library, whatever its schema version."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from slamreplay.bundle.manifest import Loss, Source
from slamreplay.errors import LogError
from slamreplay.ingest.readers.reader import Connection, normalise_type
from slamreplay.ingest.readers.sqlite.salvage import Salvaged, salvage

MAGIC = b"SQLite format 3\0"
_FORMATS = {"ros2msg": "msg", "ros2idl": "idl"}


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
        self._total = sum(counts.values())
        self._indices = {row[0]: index for index, row in enumerate(topics)}
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

    def messages(self, wanted: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """See `Reader`."""
        self.losses.clear()
        if self._salvaged is not None:
            for number, t_log_ns, data in self._salvaged.messages():
                index = self._indices.get(number)
                if index is not None and index in wanted:
                    yield index, t_log_ns, data
            self.losses += self._salvaged.losses(self._path.name)
            return
        read = 0
        try:
            with self._database() as database:
                rows = database.execute(
                    "SELECT topic_id, timestamp, data FROM messages"
                    " WHERE typeof(timestamp) = 'integer' AND typeof(data) = 'blob' ORDER BY id"
                )
                for number, t_log_ns, data in rows:
                    index = self._indices.get(number)
                    read += index is not None
                    if index is not None and index in wanted:
                        yield index, t_log_ns, data
            self._lose(self._total - read, "no blob, no time, or its topic is in no row")
        except sqlite3.Error as error:
            self._lose(max(self._total - read, 1), f"damaged SQLite file: {error}")

    def _lose(self, count: int, reason: str) -> None:
        if count:
            what = f"{self._path.name}: messages"
            self.losses.append(Loss(kind="lost", what=what, count=count, reason=reason))

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
                yield database
            return
        # Its newest messages are in the write-ahead log, which SQLite would fold into the file.
        with TemporaryDirectory(prefix="slamreplay-") as folder:
            for file in (self._path, log):
                shutil.copy(file, folder)
            with closing(sqlite3.connect(Path(folder) / self._path.name)) as database:
                yield database
