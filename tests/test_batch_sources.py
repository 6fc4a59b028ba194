"""Which logs a batch looks at: folders, files and patterns on this machine."""

import os
from pathlib import Path

import pytest

from slamreplay.batch.fetch import fetch
from slamreplay.batch.sources import sources_of
from slamreplay.errors import LogError, SlamreplayError


@pytest.fixture
def fleet(tmp_path, monkeypatch):
    """A folder with a log of each kind, and what is none."""
    for name in (
        "north/amr-1/a.mcap", "north/amr-1/b.bag", "north/amr-2/c.db3", "north/amr-2/c.db3-wal",
        "north/amr-2/notes.txt", "south/run/metadata.yaml", "south/run/run_0.mcap",
        "south/run/run_1.mcap", "south/killed/killed_0.db3", "south/killed/killed_1.db3",
        "south/robots/Robot1_Odometry.dat", "south/robots/Barcodes.dat", "south/old.clf.gz",
        "south/x.bundle/manifest.json", "south/x.bundle/tables/scans.parquet", ".hidden/d.mcap",
        "north/amr-1/.e.mcap", "north/amr-1/f.bag.active",
    ):  # fmt: skip
        file = tmp_path / "logs" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(name.encode())
    monkeypatch.chdir(tmp_path)
    return tmp_path / "logs"


def names(places, **kwargs):
    return [source.log for source in sources_of(places, **kwargs)]


ALL = [
    "logs/north/amr-1/a.mcap", "logs/north/amr-1/b.bag", "logs/north/amr-2/c.db3",
    "logs/south/killed", "logs/south/old.clf.gz", "logs/south/robots", "logs/south/run",
    "logs/south/x.bundle",
]  # fmt: skip


def test_a_folder_is_all_logs_below_it_each_once(fleet):
    assert names(["logs"]) == ALL
    assert names(["./logs/", "logs/north", "logs/south/run"]) == ALL


def test_files_that_belong_together_are_one_log(fleet):
    found = {source.log: source for source in sources_of(["logs"])}
    run = found["logs/south/run"]
    assert run.folder == "run"
    assert [f.name for f in run.files] == ["metadata.yaml", "run_0.mcap", "run_1.mcap"]
    assert [f.name for f in found["logs/south/killed"].files] == ["killed_0.db3", "killed_1.db3"]
    assert [f.name for f in found["logs/north/amr-2/c.db3"].files] == ["c.db3", "c.db3-wal"]
    bundle = found["logs/south/x.bundle"]
    assert [f.name for f in bundle.files] == ["manifest.json", "tables/scans.parquet"]


@pytest.mark.parametrize(
    ("pattern", "expected"),
    [
        ("logs/**/*.mcap", ["logs/north/amr-1/a.mcap", "logs/south/run"]),
        ("logs/*/*.gz", ["logs/south/old.clf.gz"]),
        ("logs/n*", [n for n in ALL if "north" in n]),
        ("logs/south/ru[n]", ["logs/south/run"]),
        ("logs/*/amr-?/[!a]*", ["logs/north/amr-1/b.bag", "logs/north/amr-2/c.db3"]),
        ("l*/south/x.bundle", ["logs/south/x.bundle"]),
    ],
)
def test_a_pattern_names_logs_their_folders_or_their_files(fleet, pattern, expected):
    assert names([pattern]) == expected
    absolute = f"{fleet.parent}/{pattern}"
    assert names([absolute]) == [f"{fleet.parent}/{name}" for name in expected]


def test_a_pattern_looks_only_into_folders_it_reaches(fleet, monkeypatch):
    seen = []
    scandir = os.scandir
    monkeypatch.setattr(os, "scandir", lambda path: seen.append(path) or scandir(path))
    sources_of(["logs/north/*/*.bag"])
    assert {Path(p).name for p in seen} == {"north", "amr-1", "amr-2"}


def test_wildcards_in_the_names_of_folders_that_are_there_are_no_pattern(fleet, monkeypatch):
    odd = fleet / "[old] {x}"
    odd.mkdir()
    (odd / "a.mcap").write_bytes(b"a")
    monkeypatch.chdir(odd)
    assert names(["*.mcap"]) == ["a.mcap"]
    assert names([str(odd)]) == [f"{odd}/a.mcap"]


def test_a_file_that_is_named_itself_is_taken_whatever_it_is_called(fleet):
    (fleet / "odd.log").write_bytes(b"x")
    assert names(["logs/odd.log"]) == ["logs/odd.log"]
    assert names([f"file://{fleet}/odd.log"]) == [f"{fleet}/odd.log"]


def test_links_are_followed_once(fleet):
    (fleet / "loop").symlink_to(fleet)
    (fleet / "again.mcap").symlink_to(fleet / "north/amr-1/a.mcap")
    (fleet / "nowhere").symlink_to(fleet / "gone")
    told = []
    assert names(["logs"], tell=told.append)[1:] == ALL[1:]
    assert told == [
        "logs: skipped 1 folders that links lead to a second time",
        "logs: skipped 1 links that lead nowhere",
    ]


def test_folders_that_cannot_be_read_are_counted(fleet, monkeypatch):
    scandir = os.scandir

    def refuse(path):
        if str(path).endswith("south"):
            raise PermissionError(13, "no")
        return scandir(path)

    monkeypatch.setattr(os, "scandir", refuse)
    told = []
    assert names(["logs"], tell=told.append) == ALL[:3]
    assert told == ["logs: skipped 1 folders that cannot be read (Permission denied)"]
    with pytest.raises(LogError, match=r"^logs/south: cannot read: Permission denied$"):
        sources_of(["logs/south"])


@pytest.mark.parametrize("place", ["gone", "gone/*.mcap", "logs/*.zip", "", "a\0b"])
def test_nothing_there_is_one_line(fleet, place):
    with pytest.raises(SlamreplayError) as caught:
        sources_of([place])
    assert "\n" not in str(caught.value)
    assert "\0" not in str(caught.value)


def test_a_name_of_any_bytes_is_shown_in_one_line(fleet):
    (fleet / os.fsdecode(b"bad\n\xff.mcap")).write_bytes(b"x")
    (name,) = names(["logs/bad*"])
    assert name == r"logs/bad\n\xff.mcap"


def test_local_files_are_read_where_they_lie(fleet, tmp_path):
    found = {source.log: source for source in sources_of(["logs"])}
    assert fetch(found["logs/south/run"], {}, tmp_path) == [fleet / "south/run"]
    assert fetch(found["logs/south/x.bundle"], {}, tmp_path) == [fleet / "south/x.bundle"]
    assert fetch(found["logs/north/amr-2/c.db3"], {}, tmp_path) == [fleet / "north/amr-2/c.db3"]


def test_a_file_that_changed_since_is_told(fleet, tmp_path):
    (source,) = sources_of(["logs/north/amr-1/a.mcap"])
    (fleet / "north/amr-1/a.mcap").write_bytes(b"north/amr-1/A.mcap")
    with pytest.raises(LogError, match="changed since the batch listed it"):
        fetch(source, {}, tmp_path)
