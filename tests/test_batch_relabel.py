"""Labels that come later reach the rows of logs that were judged before."""

from dataclasses import replace

import pyarrow as pa
import pytest

from slamreplay.batch import run
from slamreplay.batch.cluster import Workers
from slamreplay.batch.keys import key_of
from slamreplay.batch.relabel import relabel
from slamreplay.batch.run import run_batch
from slamreplay.batch.task import LogFile, LogSource, LogTask
from slamreplay.batch.worker import failed
from slamreplay.fleet.schema import TABLES, arrow_schema
from slamreplay.fleet.store import commit, read


@pytest.fixture
def folder(tmp_path):
    keys = [f"{n:032x}" for n in range(4)]
    rows = {
        "logs": [{"key": key, "log": key[-1], "site": "old", "robot": "r1"} for key in keys],
        "findings": [{"key": key, "id": "SR-LOC-001", "n": n} for n, key in enumerate(keys)],
    }
    empty = {name: arrow_schema(name).empty_table() for name in TABLES}
    commit(tmp_path, empty | {n: pa.Table.from_pylist(r, arrow_schema(n)) for n, r in rows.items()})
    return tmp_path


def task(key, **labels):
    source = LogSource("a.mcap", (LogFile("/a.mcap", "a.mcap", 1, "v"),), labels=labels)
    return LogTask(key, source)


def test_only_the_labels_of_the_logs_that_bear_others_change(folder):
    before = {name: read(folder, name) for name in TABLES}
    rows = before["logs"].to_pylist()
    told = [
        task(rows[0]["key"], site="moved", sw_version="9"),
        task(rows[1]["key"], robot=rows[1]["robot"]),
        task(rows[2]["key"], owner="nobody's column"),
        task("f" * 32, site="not judged yet"),
    ]
    assert relabel(folder, told) == 1
    after = read(folder, "logs").to_pylist()
    assert after == [rows[0] | {"site": "moved", "software": "9"}, *rows[1:]]
    for name in set(TABLES) - {"logs"}:
        assert read(folder, name).equals(before[name])
    assert relabel(folder, told) == 0


def test_a_batch_that_is_run_again_with_other_labels_tells_and_does_nothing_else(
    tmp_path, monkeypatch
):
    given = []

    def looked_back(tasks, _workers, _scratch):
        given.extend(tasks)
        for one in tasks:
            yield failed(one, "it is torn")

    monkeypatch.setattr(run, "looked_back", looked_back)
    one, told = task("0" * 32, site="n"), []
    run_batch([one], tmp_path / "b", Workers())
    run_batch([task(one.key, site="s")], tmp_path / "b", Workers(), tell=told.append)
    assert given == [one]
    assert told == ["1 logs that were there have other labels now"]
    assert read(tmp_path / "b", "logs")["site"].to_pylist() == ["s"]


def test_labels_are_no_part_of_a_key():
    source = task("").source
    assert key_of(source) == key_of(replace(source, labels={"site": "n"}))
