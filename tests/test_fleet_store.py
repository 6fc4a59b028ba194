"""Tables that grow: nothing lost, nothing twice, whoever is killed at whatever moment."""

import subprocess
import sys
import textwrap
from pathlib import Path

import duckdb
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from fleet_rows import failed_row, log_row, tables

from slamreplay.errors import OutputError
from slamreplay.fleet import compaction, snapshot
from slamreplay.fleet.compaction import compact
from slamreplay.fleet.damage import mend
from slamreplay.fleet.parts import parts_in
from slamreplay.fleet.schema import TABLES, arrow_schema
from slamreplay.fleet.store import commit, committed, read


def _finding(key, text="x"):
    return {"key": key, "id": "SR-LOC-001", "message": text}


def _add(folder, key, **told):
    commit(folder, tables(logs=[log_row(key, **told)], findings=[_finding(key)] * 2))


def _cut(file: Path, size: int = 100):
    file.write_bytes(file.read_bytes()[:-size])


def _globbed(folder, table="logs"):
    pattern = f"{folder}/tables/*/{table}.parquet"
    return duckdb.sql(f"select key from read_parquet('{pattern}', union_by_name = true)").fetchall()


def test_what_is_committed_is_read_by_key(tmp_path):
    for key in "bca":
        _add(tmp_path, key)
    commit(tmp_path, tables(logs=[failed_row("d")]))
    assert committed(tmp_path) == {"a": "done", "b": "done", "c": "done", "d": "failed"}
    logs = read(tmp_path, "logs")
    assert logs["key"].to_pylist() == list("abcd")
    assert logs.schema.equals(arrow_schema("logs"), check_metadata=True)
    assert read(tmp_path, "findings")["key"].to_pylist() == list("aabbcc")
    assert read(tmp_path, "stops").num_rows == 0


def test_a_folder_without_tables_has_no_rows(tmp_path):
    assert committed(tmp_path / "none") == {}
    assert read(tmp_path / "none", "places").schema.equals(arrow_schema("places"))
    compact(tmp_path)


def test_a_log_that_was_tried_again_counts_as_it_came_out_last(tmp_path):
    commit(tmp_path, tables(logs=[failed_row("a"), log_row("b")], findings=[_finding("b")]))
    _add(tmp_path, "a")
    commit(tmp_path, tables(logs=[log_row("b", state="lost")], findings=[_finding("b", "new")]))
    assert committed(tmp_path) == {"a": "done", "b": "done"}
    assert read(tmp_path, "logs")["state"].to_pylist() == ["healthy", "lost"]
    found = read(tmp_path, "findings").to_pylist()
    assert [(row["key"], row["message"]) for row in found] == [("a", "x"), ("a", "x"), ("b", "new")]
    compact(tmp_path)
    assert sorted(_globbed(tmp_path)) == [("a",), ("b",)]
    assert len(_globbed(tmp_path, "findings")) == 3
    assert read(tmp_path, "findings").to_pylist() == found


def test_a_pattern_over_files_finds_every_table_at_once(tmp_path):
    commit(tmp_path, tables(logs=[failed_row("a")]))
    for table in TABLES:
        assert len(_globbed(tmp_path, table)) == (table == "logs")


def test_the_same_rows_are_the_same_bytes(tmp_path):
    for name in ("one", "two"):
        _add(tmp_path / name, "a")
    one, two = ((tmp_path / n / "tables").rglob("*.parquet") for n in ("one", "two"))
    assert {f.parent.name + f.name: f.read_bytes() for f in one} == {
        f.parent.name + f.name: f.read_bytes() for f in two
    }


def test_small_parts_are_laid_together_on_the_way(tmp_path, monkeypatch):
    monkeypatch.setattr(compaction, "FAN", 4)
    monkeypatch.setattr(compaction, "MOST_LOGS", 16)
    keys = [f"{k:03d}" for k in range(38)]
    most = 0
    for key in keys:
        _add(tmp_path, key)
        most = max(most, len(parts_in(tmp_path)))
        assert len(committed(tmp_path)) == int(key) + 1
    assert most <= 3 + 3 + 3
    assert max(part.logs for part in parts_in(tmp_path)) <= 16 + 4
    assert len(_globbed(tmp_path)) == len(keys)
    before = read(tmp_path, "findings")
    assert before["key"].to_pylist() == sorted(keys * 2)
    compact(tmp_path)
    assert len(parts_in(tmp_path)) <= 4
    assert read(tmp_path, "findings").equals(before)
    names = [part.folder.name for part in parts_in(tmp_path)]
    compact(tmp_path)
    assert [part.folder.name for part in parts_in(tmp_path)] == names


def test_rows_laid_together_do_not_outrank_newer_ones_in_a_part_between(tmp_path, monkeypatch):
    monkeypatch.setattr(compaction, "MOST_LOGS", 3)
    commit(tmp_path, tables(logs=[log_row("a", state="lost")]))
    commit(tmp_path, tables(logs=[log_row(k) for k in "abcd"]))  # large: it stays
    commit(tmp_path, tables(logs=[log_row("e")]))
    compact(tmp_path)
    assert read(tmp_path, "logs")["state"].to_pylist() == ["healthy"] * 5
    assert len(_globbed(tmp_path)) == 5


def test_rows_laid_together_across_a_part_between_count_before_it(tmp_path, monkeypatch):
    monkeypatch.setattr(compaction, "MOST_LOGS", 3)
    commit(tmp_path, tables(logs=[log_row("e")]))
    commit(tmp_path, tables(logs=[log_row(k, state="lost") for k in "abcd"]))
    commit(tmp_path, tables(logs=[log_row("a")]))
    monkeypatch.setattr(compaction, "_shares", lambda parts: [[parts[0][0], parts[-1][0]]])
    compact(tmp_path)
    assert len(parts_in(tmp_path)) == 2
    assert read(tmp_path, "logs")["state"].to_pylist() == ["healthy", *["lost"] * 3, "healthy"]


def test_a_part_that_goes_while_it_is_looked_at_is_no_damage(tmp_path, monkeypatch):
    _add(tmp_path, "a")
    _add(tmp_path, "b")
    check, gone = snapshot.check_part, []

    def vanishing(part):
        if not gone:
            gone.append(part)
            compact(tmp_path)
        check(part)

    monkeypatch.setattr(snapshot, "check_part", vanishing)
    told = []
    assert read(tmp_path, "logs", told.append)["key"].to_pylist() == ["a", "b"]
    assert told == []


def test_a_part_that_was_cut_is_told_and_left_out_and_set_aside(tmp_path):
    for key in "abc":
        _add(tmp_path, key)
    bad = parts_in(tmp_path)[1]
    _cut(bad.file("findings"))
    lines = []
    assert set(committed(tmp_path, lines.append)) == {"a", "c"}
    assert len(lines) == 1
    assert str(bad.file("findings")) in lines[0]
    assert read(tmp_path, "logs", lines.append)["key"].to_pylist() == ["a", "c"]
    (line,) = mend(tmp_path)
    assert "findings.parquet: is cut off; set aside" in line
    assert len(_globbed(tmp_path, "findings")) == 4
    assert (tmp_path / "damaged" / bad.folder.name / "logs.parquet").is_file()
    assert mend(tmp_path) == []


@pytest.mark.parametrize("size", [0, 3, 11])
def test_a_file_of_a_few_bytes_is_cut(tmp_path, size):
    _add(tmp_path, "a")
    file = parts_in(tmp_path)[0].file("logs")
    file.write_bytes(file.read_bytes()[:size])
    lines = []
    assert committed(tmp_path, lines.append) == {}
    assert len(lines) == 1


def test_a_flipped_bit_is_told_and_nothing_of_its_part_is_carried_over(tmp_path):
    for key in "abc":
        _add(tmp_path, key)
    bad = parts_in(tmp_path)[2]
    file = bad.file("findings")
    content = bytearray(file.read_bytes())
    offset = pq.ParquetFile(file).metadata.row_group(0).column(0).dictionary_page_offset
    content[offset + 30] ^= 0x10
    file.write_bytes(content)
    lines = []
    assert set(read(tmp_path, "findings", lines.append)["key"].to_pylist()) == {"a", "b"}
    assert len(lines) == 1
    assert str(file) in lines[0]
    lines.clear()
    compact(tmp_path, lines.append)
    assert len(lines) == 1
    assert "set aside" in lines[0]
    assert set(committed(tmp_path)) == {"a", "b"}
    assert len(parts_in(tmp_path)) == 1


def test_parts_of_an_older_and_a_newer_version_are_read_together(tmp_path):
    _add(tmp_path, "a")
    plain = tables(logs=[log_row("b"), log_row("c")])["logs"]
    older = plain.drop_columns(["lost_times"])
    newer = plain.append_column("mood", pa.array(["good", "bad"]))
    commit(tmp_path, {"logs": older})
    commit(tmp_path, {"logs": newer.filter(pa.array([False, True]))})
    for _ in range(2):
        found = read(tmp_path, "logs")
        assert found["lost_times"].to_pylist() == [0, None, 0]
        assert found["mood"].to_pylist() == [None, None, "bad"]
        compact(tmp_path)
    assert len(parts_in(tmp_path)) == 1


def test_a_part_without_a_table_that_came_later_is_read(tmp_path):
    _add(tmp_path, "a")
    _add(tmp_path, "b")
    parts_in(tmp_path)[0].file("costs").unlink()
    lines = []
    assert read(tmp_path, "costs", lines.append).num_rows == 0
    compact(tmp_path, lines.append)
    assert lines == []
    assert len(read(tmp_path, "findings")) == 4


def test_a_place_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "tables").write_text("in the way")
    with pytest.raises(OutputError, match="cannot write"):
        _add(tmp_path, "a")
    assert not list((tmp_path / ".unfinished").iterdir())
    with pytest.raises(ValueError, match="row of logs"):
        commit(tmp_path, tables(findings=[_finding("a")]))


KILLED = """
    import os, shutil, sys
    from pathlib import Path
    from fleet_rows import log_row, tables
    from pyarrow.parquet import read_table
    from slamreplay.fleet import compaction, parts
    from slamreplay.fleet.compaction import compact
    from slamreplay.fleet.parts import parts_in
    from slamreplay.fleet.store import commit, committed, read

    # Two tables are as good as eight, and four times as fast.
    compaction.TABLES = parts.TABLES = {name: parts.TABLES[name] for name in ("logs", "findings")}
    start, folder = Path(sys.argv[1]), Path(sys.argv[2])
    count = [None]

    def hook(event, arguments):
        if count[0] is None or not event.startswith(("open", "os.", "shutil.", "tempfile.")):
            return
        count[0] -= 1
        if count[0] < 0:
            os._exit(9)

    sys.addaudithook(hook)

    def act():
        if sys.argv[3] == "compact":
            compact(folder)
        else:
            commit(folder, tables(logs=[log_row("z")], findings=[{"key": "z", "id": "x"}]))

    def keys(table):
        return read(folder, table)["key"].to_pylist()

    shutil.copytree(start, folder)
    act()  # what loads modules is loaded before the counting begins
    after = keys("logs"), keys("findings")
    before = sorted(set(after[0]) - {"z"}), sorted(set(after[1]) - {"z"})
    steps, twice = 0, 0
    while True:
        shutil.rmtree(folder)
        shutil.copytree(start, folder)
        child = os.fork()
        if not child:
            count[0] = steps
            act()
            os._exit(0)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if code == 0:
            break
        assert code == 9, code
        found = keys("logs"), keys("findings")
        if sys.argv[3] == "compact":
            assert found == after, (steps, found)
        else:  # all of it or nothing
            assert found in (after, before), (steps, found)
        assert set(committed(folder)) == set(found[0])
        raw = [k for p in parts_in(folder) for k in read_table(p.file("logs"))["key"].to_pylist()]
        assert set(raw) == set(found[0])
        twice += len(raw) > len(found[0])
        act()
        compact(folder)
        assert (keys("logs"), keys("findings")) == after, steps
        assert len(parts_in(folder)) == 1
        steps += 1
    print(steps, twice)
"""


@pytest.mark.parametrize("act", ["commit", "compact"])
def test_killed_at_any_step_nothing_is_lost_and_nothing_counts_twice(tmp_path, act):
    start = tmp_path / "start"
    for key in "ab":
        commit(start, tables(logs=[log_row(key)], findings=[{"key": key, "id": "x"}]))
    commit(start, tables(logs=[log_row("b", state="lost")], findings=[{"key": "b", "id": "y"}]))
    for file in start.rglob("*.parquet"):
        if file.stem not in ("logs", "findings"):
            file.unlink()
    script = textwrap.dedent(KILLED)
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", script, start, tmp_path / "work", act],
        cwd=Path(__file__).parent,
        env={"PYTHONPATH": f"{Path(__file__).parents[1]}:{Path(__file__).parent}"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    steps, twice = map(int, done.stdout.split())
    assert steps > 10
    if act == "compact":  # else the test would not see what it is for
        assert twice
