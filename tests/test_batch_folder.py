"""The folder of a batch: names in it, whose it is, and one program in it at a time."""

import errno
import json
import os
import subprocess
import sys

import pytest

from slamreplay.batch.folder import batch_folder, report_folder
from slamreplay.batch.lock import held_lock
from slamreplay.batch.task import LogSource, LogTask
from slamreplay.errors import OutputError

HOLD = """
import sys, time
from pathlib import Path
from slamreplay.batch.lock import held_lock
with held_lock(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


def folder_of(log):
    return report_folder(LogTask("0123456789abcdef" * 2, LogSource(log, ())))


@pytest.mark.parametrize(
    ("log", "name"),
    [
        ("/data/day 1/run.mcap", "run.mcap"),
        ("s3://bucket/site/run_7/", "run_7"),
        ("/data/../..", "log"),
        ("/data/.hidden", "hidden"),
        ("C:\\logs\\ümlaut.bag", "mlaut.bag"),
        ("/data/" + "x" * 300, "x" * 60),
    ],
)
def test_reports_lie_under_a_name_that_any_system_takes(log, name):
    assert folder_of(log) == f"logs/{name}-0123456789ab"


def test_scratch_is_gone_afterwards(tmp_path):
    target = tmp_path / "new" / "batch"
    with batch_folder(target) as scratch:
        (scratch / "large").write_bytes(b"x")

    assert sorted(p.name for p in target.iterdir()) == [".lock", "batch.json"]


def test_scratch_of_one_that_was_killed_is_cleared(tmp_path):
    with batch_folder(tmp_path / "b"):
        pass
    left = tmp_path / "b" / ".scratch" / "left"
    left.mkdir(parents=True)

    with batch_folder(tmp_path / "b"):
        assert not left.exists()


def test_what_one_that_was_killed_had_not_finished_is_cleared(tmp_path):
    target = tmp_path / "b"
    with batch_folder(target):
        pass
    for name in ("logs/.run.mcap-0123.x7", "logs/.run.mcap-0123.x7.old", "maps/.0123.y8"):
        (target / name).mkdir(parents=True)
        (target / name / "report.html").write_text("<html>")
    (target / ".fleet.html.z9").write_text("<html>")
    (target / "logs" / "run.mcap-4567").mkdir()
    (target / "fleet.html").write_text("<html></html>")

    with batch_folder(target):
        left = sorted(path.name for path in target.rglob("*") if path.name != ".scratch")

    assert left == [".lock", "batch.json", "fleet.html", "logs", "maps", "run.mcap-4567"]


def test_a_full_disk_is_one_line(tmp_path, monkeypatch):
    def full(*_arguments):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with batch_folder(tmp_path / "b"):
        pass
    monkeypatch.setattr(os, "write", full)

    with (
        pytest.raises(OutputError, match=r"\.lock: cannot write: No space left"),
        batch_folder(tmp_path / "b"),
    ):
        pass


def test_a_foreign_folder_is_refused(tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")

    with pytest.raises(OutputError, match="exists and holds no batch"), batch_folder(tmp_path):
        pass


@pytest.mark.parametrize("text", ["", "[]", '{"slamreplay": "batch", "version": 99}'])
def test_a_folder_of_another_version_is_refused(tmp_path, text):
    (tmp_path / "batch.json").write_text(text)

    with pytest.raises(OutputError, match=r"batch\.json: is "), batch_folder(tmp_path):
        pass


def test_the_lock_of_a_living_program_holds_and_that_of_a_killed_one_does_not(tmp_path):
    path = tmp_path / ".lock"
    holder = subprocess.Popen([sys.executable, "-c", HOLD, path], stdout=subprocess.PIPE, text=True)
    with holder:
        assert holder.stdout.readline() == "held\n"
        with (
            pytest.raises(OutputError, match=f"process {holder.pid} on .* is at work here"),
            held_lock(path),
        ):
            pass
        holder.kill()

    with held_lock(path):
        assert json.loads(path.read_text())["pid"] == os.getpid()
    assert path.read_text() == ""


def test_a_lock_from_another_machine_is_not_taken(tmp_path):
    path = tmp_path / ".lock"
    path.write_text('{"pid": 7, "host": "elsewhere"}')

    with pytest.raises(OutputError, match=r"elsewhere .* may still be .*remove"), held_lock(path):
        pass


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks /proc when a process began")
def test_where_a_file_system_has_no_locks_the_number_of_a_process_alone_holds_nobody(
    tmp_path, monkeypatch
):
    import fcntl

    def no_locks(*_arguments):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", no_locks)
    path = tmp_path / ".lock"
    with held_lock(path):
        mine = path.read_text()
        with pytest.raises(OutputError, match="is at work here"), held_lock(path):
            pass
    path.write_text(json.dumps(json.loads(mine) | {"since": "another boot 7"}))

    with held_lock(path):
        assert path.read_text() == mine


def test_a_damaged_lock_holds_nobody_up(tmp_path):
    (tmp_path / ".lock").write_text("[7")

    with held_lock(tmp_path / ".lock"):
        pass
