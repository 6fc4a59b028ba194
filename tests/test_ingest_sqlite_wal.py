"""A database with its write-ahead log is read as SQLite reads it, where it lies."""

import shutil
import sqlite3
from contextlib import closing

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sqlite_files import SCHEMAS, TOPICS, add_messages, add_topics, rows, some_messages, write_db3

from slamreplay.ingest.readers.sqlite.salvage import salvage
from slamreplay.ingest.readers.sqlite.wal import _sums


@pytest.fixture(scope="module", params=[512, 4096])
def logged(request, tmp_path_factory):
    """A database and its write-ahead log, as a recorder that died leaves them."""
    folder = tmp_path_factory.mktemp("wal")
    live = folder / f"live{request.param}.db3"
    path = folder / "dead" / live.name
    path.parent.mkdir(exist_ok=True)
    messages = some_messages([60, 300, 5000, 9000] * 60)
    write_db3(live, messages[:100], page_size=request.param)
    with closing(sqlite3.connect(live)) as database:
        database.execute("PRAGMA journal_mode = WAL")
        database.execute("PRAGMA wal_autocheckpoint = 0")
        database.execute(
            "PRAGMA cache_size = 10"
        )  # so that a transaction is written before its end
        add_messages(database, messages[100:150])
        database.execute("PRAGMA wal_checkpoint(RESTART)")
        for first in range(150, 200, 10):
            add_messages(database, messages[first : first + 10])
        database.execute("DELETE FROM messages WHERE id BETWEEN 20 AND 60")
        database.commit()
        database.executemany("INSERT INTO messages VALUES (NULL, ?, ?, ?)", messages[200:])
        for suffix in ("", "-wal"):
            shutil.copy(f"{live}{suffix}", f"{path}{suffix}")
    return path, messages


def read_by_sqlite(path):
    """What SQLite reads of a copy that it may write to."""
    copies = path.parent / "copies"
    shutil.rmtree(copies, ignore_errors=True)
    copies.mkdir()
    for suffix in ("", "-wal"):
        shutil.copy(f"{path}{suffix}", copies)
    with closing(sqlite3.connect(copies / path.name)) as database:
        return database.execute(
            "SELECT topic_id, timestamp, data FROM messages ORDER BY id"
        ).fetchall()


def test_committed_messages_of_the_write_ahead_log_are_read(logged):
    path, messages = logged
    expected = messages[:19] + messages[60:200]
    assert len(rows(path)) < 200  # the file alone lacks some
    assert read_by_sqlite(path) == expected
    before = {p.name: p.read_bytes() for p in path.parent.iterdir() if p.is_file()}

    salvaged = salvage(path)

    assert list(salvaged.messages()) == expected
    assert salvaged.topics == TOPICS
    assert (salvaged.lost, salvaged.unread_bytes) == (0, 0)
    assert {p.name: p.read_bytes() for p in path.parent.iterdir() if p.is_file()} == before


@settings(
    deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(share=st.floats(0, 1), flip=st.integers(0, 255), cut=st.booleans())
def test_a_damaged_write_ahead_log_is_read_as_sqlite_reads_it(logged, share, flip, cut):
    path, _ = logged
    folder = path.parent / "damaged"
    folder.mkdir(exist_ok=True)
    copy = folder / path.name
    shutil.copy(path, copy)
    content = bytearray(path.with_name(f"{path.name}-wal").read_bytes())
    at = int(share * (len(content) - 1))
    content[at] ^= flip
    copy.with_name(f"{copy.name}-wal").write_bytes(content[: at + 1] if cut else content)

    salvaged = salvage(copy)

    assert list(salvaged.messages()) == read_by_sqlite(copy)
    assert (salvaged.lost, salvaged.unread_bytes) == (0, 0)


def test_every_byte_of_a_frames_header_counts(logged, tmp_path):
    path, _ = logged
    log = path.with_name(f"{path.name}-wal").read_bytes()
    frame = 24 + int.from_bytes(log[8:12])
    copy = tmp_path / path.name
    shutil.copy(path, copy)
    for at in [*range(32), *range(32 + 9 * frame, 32 + 9 * frame + 24)]:
        content = bytearray(log)
        content[at] ^= 4
        copy.with_name(f"{copy.name}-wal").write_bytes(content)

        assert list(salvage(copy).messages()) == read_by_sqlite(copy), at


def test_a_log_whose_file_is_empty_still_has_its_messages(tmp_path):
    messages = some_messages([60, 300, 5000] * 20)
    with closing(sqlite3.connect(tmp_path / "live.db3")) as database:
        database.execute("PRAGMA journal_mode = WAL")
        for statement in SCHEMAS[4]:
            database.execute(statement)
        add_topics(database, 4)
        add_messages(database, messages)
        shutil.copy(tmp_path / "live.db3-wal", tmp_path / "a.db3-wal")
    (tmp_path / "a.db3").touch()

    salvaged = salvage(tmp_path / "a.db3")

    assert list(salvaged.messages()) == messages
    assert (salvaged.lost, salvaged.unread_bytes) == (0, 0)
    assert salvaged.topics == TOPICS


@given(st.lists(st.integers(0, 2**32 - 1), min_size=2, max_size=40), st.integers(0, 2**32 - 1))
def test_checksums_are_those_of_the_formats_own_loop(words, start):
    words = words[: len(words) // 2 * 2]
    a = b = start
    for x, y in zip(words[::2], words[1::2], strict=True):
        a = (a + x + b) & 0xFFFFFFFF
        b = (b + y + a) & 0xFFFFFFFF

    sums = _sums(np.array([words], dtype=np.uint32), np.full((1, 2), start, dtype=np.uint32))

    assert sums.tolist() == [[a, b]]
