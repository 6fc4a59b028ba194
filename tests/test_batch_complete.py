"""Is a log all there: cut at every place a copy may have come to, and as recorders leave it."""

import bz2
import gzip
import os
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
import zstandard

from slamreplay.batch.complete import is_complete, is_temporary

SAMPLES = Path(__file__).resolve().parents[1] / "sample_logs"


def state(path):
    said = is_complete(path)
    assert said.reason
    assert "\n" not in said.reason
    return said.state


@pytest.mark.parametrize("name", ["healthy.mcap", "healthy_short.bag"])
def test_a_container_is_complete_with_its_last_byte(tmp_path, name):
    whole = (SAMPLES / name).read_bytes()
    path = tmp_path / name
    path.write_bytes(whole)
    assert state(path) == "yes"
    for cut in (0, 13, 60, 5000, len(whole) // 2, len(whole) - 200, len(whole) - 1):
        path.write_bytes(whole[:cut])
        assert state(path) == "no", cut
    path.write_bytes(whole[:5])  # of so few no format can be told
    assert state(path) == "unknown"


def test_a_bag_whose_recorder_still_runs_is_not(tmp_path):
    whole = bytearray((SAMPLES / "healthy_short.bag").read_bytes())
    at = whole.index(b"index_pos=") + len(b"index_pos=")
    whole[at : at + 8] = bytes(8)
    (tmp_path / "a.bag").write_bytes(whole)
    assert is_complete(tmp_path / "a.bag").reason == "its recorder has not closed it"


@pytest.mark.parametrize(
    ("field", "value", "reason"),
    [
        (b"index_pos=", b"index_pos=" + b"\xff" * 8, "its index is not all there yet"),
        (b"chunk_count=", b"chunk_count=" + b"\xff" * 4, "its index is not all there yet"),
        (b"index_pos=", b"other_pos=", "its header is not whole"),
    ],
)
def test_a_bag_whose_header_does_not_fit_is_not(tmp_path, field, value, reason):
    whole = bytearray((SAMPLES / "healthy_short.bag").read_bytes())
    at = whole.index(field)
    whole[at : at + len(value)] = value
    (tmp_path / "a.bag").write_bytes(whole)
    assert is_complete(tmp_path / "a.bag").reason == reason


def test_a_closed_bag_tells_of_what_it_holds(tmp_path):
    whole = (SAMPLES / "healthy_short.bag").read_bytes()
    for field in (b"conn_count=", b"chunk_count="):
        at = whole.index(field) + len(field)
        whole = whole[:at] + bytes(4) + whole[at + 4 :]
    (tmp_path / "a.bag").write_bytes(whole)
    assert is_complete(tmp_path / "a.bag").reason == "its index is not all there yet"


def test_the_magic_alone_does_not_close_an_mcap_file(tmp_path):
    magic = b"\x89MCAP0\r\n"
    (tmp_path / "a.mcap").write_bytes(magic + bytes(100) + magic)
    assert state(tmp_path / "a.mcap") == "no"


def test_a_database_is_known_to_be_cut_but_not_to_be_closed(tmp_path):
    path = tmp_path / "a.db3"
    shutil.copy(SAMPLES / "healthy_short.db3", path)
    assert state(path) == "unknown"
    os.truncate(path, path.stat().st_size - 4096)
    assert "4096 bytes of it are not there yet" in is_complete(path).reason


def test_a_database_with_a_log_of_writes_is_not(tmp_path):
    path = tmp_path / "a.db3"
    with closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA journal_mode=WAL")
        database.execute("CREATE TABLE t(x)")
        database.commit()
        assert is_complete(path).reason == "its wal holds what is not in it yet"


def _folder(folder):
    folder.mkdir()
    shutil.copy(SAMPLES / "healthy_short.db3", folder / "run_0.db3")
    shutil.copy(SAMPLES / "healthy_short.db3", folder / "run_1.db3")
    text = "rosbag2_bagfile_information:\n  relative_file_paths: [run_0.db3, old/run_1.db3]\n"
    (folder / "metadata.yaml").write_text(text)


def test_a_folder_is_complete_with_all_files_that_it_names(tmp_path):
    folder = tmp_path / "run"
    _folder(folder)
    assert state(folder) == "yes"
    text = (folder / "metadata.yaml").read_text()
    for broken in ("", text[:40], text[:-9], "- [", "1"):
        (folder / "metadata.yaml").write_text(broken)
        assert state(folder) == "no", broken
    (folder / "metadata.yaml").write_text(text)
    os.truncate(folder / "run_1.db3", 100_000)
    assert is_complete(folder).reason.startswith("run_1.db3: ")
    (folder / "run_1.db3").unlink()
    assert is_complete(folder).reason == "run_1.db3 is not there yet"
    (folder / ".run_1.db3.x7Gh2k").write_bytes(b"")
    assert "temporary" in is_complete(folder).reason
    (folder / "metadata.yaml").unlink()
    (folder / ".run_1.db3.x7Gh2k").unlink()
    assert is_complete(folder).reason == "there is no metadata.yaml yet"


def _zstd(data, **kwargs):
    return zstandard.ZstdCompressor(**kwargs).compress(data)


@pytest.mark.parametrize(
    "pack",
    [
        gzip.compress, bz2.compress, _zstd,
        lambda data: _zstd(data, write_checksum=True, write_content_size=False),
        lambda data: _zstd(data[:70_000]) + _zstd(data[70_000:]),
        lambda data: _zstd(bytes(400_000)),
    ],
    ids=["gzip", "bzip2", "zstd", "checksum", "frames", "repeated"],
)  # fmt: skip
def test_a_compressed_text_is_complete_with_its_trailer(tmp_path, pack):
    whole = pack(os.urandom(30_000) * 5)
    path = tmp_path / "a.clf.gz"
    path.write_bytes(whole)
    assert state(path) == "yes"
    for cut in (len(whole) - 1, len(whole) - 5, len(whole) * 2 // 3, 12):
        path.write_bytes(whole[:cut])
        assert state(path) == "no", cut


def test_what_has_no_end_is_to_be_watched(tmp_path):
    (tmp_path / "a.clf").write_text("ODOM 0 0 0\n")
    assert state(tmp_path / "a.clf") == "unknown"
    (tmp_path / "mrclam").mkdir()
    (tmp_path / "mrclam/Robot1_Odometry.dat").write_text("0 0 0\n")
    assert state(tmp_path / "mrclam") == "unknown"


def test_what_cannot_be_read_is_not_complete(tmp_path):
    assert is_complete(tmp_path / "gone.mcap").reason == "it is gone"


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("a.mcap", False), ("run_0.db3", False), ("a.partial-results.bag", False),
        ("a.bag.active", True), (".a.mcap.x7Gh2k", True), ("a.mcap.part", True), ("a.tmp", True),
        ("a.mcap.crdownload", True), ("a.mcap.filepart", True), ("a.mcap~", True),
    ],
)  # fmt: skip
def test_temporary_names(name, expected):
    assert is_temporary(name) == expected
