"""What a worker makes of one log: the same each time, a line where it fails, and nothing left."""

import json
import sys
from dataclasses import replace

import pytest
from batch_folders import write_tiny_log

from slamreplay.batch import worker
from slamreplay.batch.keys import task_of
from slamreplay.batch.loop import _with_attempts
from slamreplay.batch.sources import sources_of
from slamreplay.batch.worker import line_of, look_back
from slamreplay.errors import LogError
from slamreplay.fleet.schema import TABLES
from slamreplay.gate.rules import Demands, Rules


@pytest.fixture(scope="module")
def task(tmp_path_factory, logs_in):
    path = write_tiny_log(logs_in(tmp_path_factory.mktemp("logs")), "tiny.mcap")
    (source,) = sources_of([str(path)])
    return task_of(source, cause=False)


@pytest.fixture(scope="module")
def result(task, tmp_path_factory):
    return look_back(task, tmp_path_factory.mktemp("scratch"))


def test_the_same_task_gives_the_same_bytes_wherever_it_is_done(task, result, tmp_path):
    again = look_back(task, tmp_path)

    assert again.error is None
    assert again.files == result.files
    assert set(again.tables) == set(TABLES)
    for name in set(TABLES) - {"costs"}:
        assert again.tables[name].equals(result.tables[name]), name
    assert list(tmp_path.iterdir()) == []


def test_the_row_tells_where_the_report_will_be(task, result):
    (row,) = result.tables["logs"].to_pylist()

    assert row["key"] == task.key
    assert (row["status"], row["error"]) == ("done", None)
    assert row["report"] == f"logs/tiny.mcap-{task.key[:12]}"
    assert row["bytes"] == task.source.files[0].size
    assert {"report.json", "report.html"} <= set(result.files)


def test_a_gate_says_its_word_in_the_row_and_all_of_it_beside_the_report(task, tmp_path):
    demands = Demands("Is all well?", Rules(expect=("state=insufficient_data",)))

    result = look_back(replace(task, demands=demands), tmp_path)

    (row,) = result.tables["logs"].to_pylist()
    told = json.loads(result.files["gate.json"])
    assert row["gate"] == "passed"
    assert told["question"] == "Is all well?"
    assert [one["status"] for one in told["logs"]] == ["passed"]


def test_without_a_gate_nothing_is_said_of_one(result):
    assert result.tables["logs"].column("gate").to_pylist() == [None]
    assert "gate.json" not in result.files


def test_the_costs_are_those_of_a_process_that_worked(result):
    (row,) = result.tables["costs"].to_pylist()

    assert row["cpu_s"] > 0
    assert row["wall_s"] > 0
    assert row["peak_mb"] > 50


def test_the_memory_is_told_where_the_system_tells_it(monkeypatch):
    def no_proc(*_args, **_kwargs):
        raise FileNotFoundError

    monkeypatch.setattr(worker.Path, "read_text", no_proc)
    assert 50 < worker.peak_mb() < 50_000
    monkeypatch.setitem(sys.modules, "resource", None)  # as on Windows
    assert worker.peak_mb() is None


def test_how_often_a_log_was_begun_is_told_by_who_knows(result):
    told = _with_attempts(result, 3)

    assert told.tables["costs"].column("attempts").to_pylist() == [3]
    assert told.tables["costs"].schema.equals(result.tables["costs"].schema, check_metadata=True)


def test_a_log_that_cannot_be_read_gives_its_line(tmp_path):
    (tmp_path / "torn.mcap").write_bytes(b"not a log")
    (source,) = sources_of([str(tmp_path)])
    scratch = tmp_path / "scratch"
    scratch.mkdir()

    result = look_back(task_of(source), scratch)

    assert "not a log that is known here" in result.error
    assert not result.error.startswith("/")  # the row names the log beside it
    assert result.error.count("\n") == 0
    assert str(scratch) not in result.error
    (row,) = result.tables["logs"].to_pylist()
    assert (row["status"], row["error"]) == ("failed", result.error)
    assert (result.files, result.map_files) == ({}, {})
    assert list(scratch.iterdir()) == []


def test_a_fault_of_ours_is_told_with_its_place(task, tmp_path, monkeypatch):
    def judged(task, folder, spent):
        (folder / "large").write_bytes(b"x")
        raise ZeroDivisionError("by\nnought")

    monkeypatch.setattr(worker, "_judged", judged)

    result = look_back(task, tmp_path)

    said = "a fault of ours: ZeroDivisionError: by nought at test_batch_worker.py:"
    assert result.error.startswith(said)
    assert list(tmp_path.iterdir()) == []


def test_the_scratch_folder_stands_in_no_line(task, tmp_path, monkeypatch):
    def judged(task, folder, spent):
        raise LogError("no such file", where=folder / "log" / "run.mcap")

    monkeypatch.setattr(worker, "_judged", judged)

    assert look_back(task, tmp_path).error == "run.mcap: no such file"


def test_a_worker_whose_disk_is_full_fails_the_log_and_not_the_batch(task, tmp_path):
    result = look_back(task, tmp_path / "gone")

    assert result.error == "cannot write: No such file or directory, to the folder of its worker"
    assert result.tables["logs"].column("status").to_pylist() == ["failed"]


def test_lack_of_memory_is_no_fault_of_ours():
    assert line_of(MemoryError()).startswith("not enough memory")
