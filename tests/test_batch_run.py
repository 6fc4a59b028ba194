"""A batch's folder over several runs: what is missing is done, what is there is kept."""

import pytest
from batch_folders import check_whole

from slamreplay.batch import run
from slamreplay.batch.cluster import Workers
from slamreplay.batch.folder import report_folder
from slamreplay.batch.run import run_batch
from slamreplay.batch.task import LogFile, LogResult, LogSource, LogTask
from slamreplay.batch.worker import failed
from slamreplay.fleet.schema import arrow_schema
from slamreplay.fleet.store import read

MAP = "sha256:0123456789abcdef0123"


def task(name, size=100):
    key = f"{name:0>32}".encode().hex()[-32:]
    return LogTask(key, LogSource(f"{name}.mcap", (LogFile(f"/{name}", name, size, ""),)))


def result_of(one, state="healthy"):
    import pyarrow as pa

    row = dict.fromkeys(arrow_schema("logs").names) | {
        "key": one.key, "log": one.source.log, "status": "done", "state": state,
        "report": report_folder(one), "map_version": MAP,
    }  # fmt: skip
    files = {"report.json": b'{"schema_version": 1}', "report.html": b"<html></html>"}
    maps = {"map.yaml": b"image: map.pgm", "map.pgm": b"P5"}
    logs = pa.Table.from_pylist([row], arrow_schema("logs"))
    return LogResult(one.key, None, files, maps, {"logs": logs})


@pytest.fixture
def worked(monkeypatch):
    """Logs that were worked on; those with `torn` in their name fail."""
    names = []

    def looked_back(tasks, workers, scratch):
        for one in tasks:
            names.append(one.source.log.removesuffix(".mcap"))
            torn = "torn" in one.source.log
            state = "lost" if "lost" in one.source.log else "healthy"
            yield failed(one, "it is torn") if torn else result_of(one, state)

    monkeypatch.setattr(run, "looked_back", looked_back)
    return names


def test_a_map_that_is_there_is_not_written_again(worked, tmp_path):
    run_batch([task("a")], tmp_path / "b", Workers())
    (there,) = (tmp_path / "b" / "maps").glob("*/map.yaml")
    before = there.stat().st_ino, there.stat().st_mtime_ns
    run_batch([task("lost")], tmp_path / "b", Workers())

    assert (there.stat().st_ino, there.stat().st_mtime_ns) == before


def test_the_same_again_does_nothing_and_tells_the_same(worked, tmp_path):
    tasks = [task("a"), task("torn"), task("lost")]
    first = run_batch(tasks, tmp_path / "b", Workers())
    again = run_batch(tasks, tmp_path / "b", Workers())

    assert worked == ["a", "torn", "lost"]
    assert (first.kept, again.kept) == (0, 3)
    assert first.states == again.states == {"healthy": 1, "lost": 1}
    assert first.failed == again.failed == (("torn.mcap", "it is torn"),)
    assert first.fleet == again.fleet
    assert first.fleet[0].startswith("Of 3 logs ")
    assert first.fleet[-1] == "1 log could not be read or judged."
    check_whole(tmp_path / "b", done=2, failed=1)


def test_another_day_adds_its_logs(worked, tmp_path):
    run_batch([task("a")], tmp_path / "b", Workers())
    end = run_batch([task("b"), task("a"), task("c")], tmp_path / "b", Workers())

    assert worked == ["a", "b", "c"]
    assert (end.logs, end.kept) == (3, 1)
    check_whole(tmp_path / "b", done=3, failed=0)


def test_failed_ones_are_tried_again_when_asked(worked, tmp_path):
    run_batch([task("a"), task("torn")], tmp_path / "b", Workers())
    end = run_batch([task("a"), task("torn")], tmp_path / "b", Workers(), again_failed=True)

    assert worked == ["a", "torn", "torn"]
    assert end.kept == 1
    check_whole(tmp_path / "b", done=1, failed=1)


def test_a_run_that_was_stopped_goes_on(worked, tmp_path):
    class StopError(Exception):
        pass

    def stop(what, _share):
        if what.startswith("2"):
            raise StopError

    with pytest.raises(StopError):
        run_batch([task(n) for n in "abcd"], tmp_path / "b", Workers(), progress=stop)
    run_batch([task(n) for n in "abcd"], tmp_path / "b", Workers())

    assert worked == ["a", "b", "c", "d"]
    check_whole(tmp_path / "b", done=4, failed=0)


def test_a_report_without_rows_is_done_again(worked, tmp_path, monkeypatch):
    """As of a client that was killed between the two."""

    def torn_off(*_arguments):
        raise OSError("killed")

    with monkeypatch.context() as patch:
        patch.setattr("slamreplay.batch.commit.commit", torn_off)
        with pytest.raises(OSError, match="killed"):
            run_batch([task("a")], tmp_path / "b", Workers())
    assert not (tmp_path / "b" / "tables").exists()
    run_batch([task("a")], tmp_path / "b", Workers())

    assert worked == ["a", "a"]
    check_whole(tmp_path / "b", done=1, failed=0)


def test_a_map_is_kept_once(worked, tmp_path):
    run_batch([task("a"), task("b")], tmp_path / "b", Workers())

    assert [p.name for p in (tmp_path / "b" / "maps").iterdir()] == ["0123456789abcdef"]
    assert {row["map_version"] for row in read(tmp_path / "b", "logs").to_pylist()} == {MAP}


def test_one_log_given_twice_is_done_once(worked, tmp_path):
    end = run_batch([task("a"), task("a")], tmp_path / "b", Workers())

    assert worked == ["a"]
    assert end.logs == 1


def test_progress_is_told_by_bytes(worked, tmp_path):
    told = []
    tasks = [task("a", 300), task("torn", 100), task("lost", 600)]

    run_batch(tasks, tmp_path / "b", Workers(), progress=lambda *what: told.append(what))

    assert told == [
        ("0 of 3", 0.0),
        ("1 of 3", 0.3),
        ("2 of 3, 1 failed", 0.4),
        ("3 of 3, 1 failed, 1 lost", 1.0),
    ]


def test_progress_is_told_by_logs_where_a_size_is_not_known(worked, tmp_path):
    told = []

    run_batch(
        [task("a", None), task("b", 100)],
        tmp_path / "b",
        Workers(),
        progress=lambda _what, share: told.append(share),
    )

    assert told == [0.0, 0.5, 1.0]
