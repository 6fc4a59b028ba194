"""The program as a service: it picks up what comes, and ends when it is told to."""

import json
import signal
import time
from pathlib import Path

import pytest
from batch_folders import (
    check_whole,
    committed,
    finished,
    lives,
    start,
    wait_until,
    workers_of,
    write_tiny_log,
)

BENCH = Path(__file__).resolve().parents[1] / "recipes" / "wheel-slip" / "recipe.yaml"


@pytest.fixture
def place(tmp_path):
    (tmp_path / "in").mkdir()
    return tmp_path / "in"


def test_from_a_half_written_log_to_its_report_until_sigterm(place, tmp_path, logs_in):
    log = write_tiny_log(logs_in(tmp_path), "a.mcap")
    content, out, heard = log.read_bytes(), tmp_path / "out", tmp_path / "heard"
    hook = f"tee -a {heard}"
    options = ("--every", 0.2, "--settle", 0.2, "--workers", 1, "--no-cause", "--json")

    def put(some):
        (tmp_path / "a.copied").write_bytes(some)
        (tmp_path / "a.copied").rename(place / "a.mcap")  # never less than that

    put(content[:-40])
    program = start("watch", place, "-o", out, *options, "--on-finished", hook)
    lacks = program.stderr.readline()
    assert "not whole: it has no footer yet" in lacks
    assert committed(out) == 0
    put(content)
    wait_until(lambda: heard.exists() and heard.read_bytes().endswith(b"\n"))
    workers = workers_of(program)
    asked = time.monotonic()
    program.send_signal(signal.SIGTERM)
    code, said, err = finished(program)

    assert (code, len(workers)) == (0, 1)
    assert time.monotonic() - asked < 60.0  # as the service of recipes/fleet and a pod allow
    wait_until(lambda: not any(map(lives, workers)))
    told = json.loads(said.splitlines()[0])
    assert (told["log"], told["state"]) == (str(place / "a.mcap"), "insufficient_data")
    assert json.loads(heard.read_text()) == told
    judged, ended = err.splitlines()
    assert f"{place / 'a.mcap'}: insufficient_data: {out}/logs/a.mcap-" in judged
    assert ended.startswith("1 logs done; ")
    check_whole(out, done=1, failed=0)


def test_once_on_nothing_new(place, tmp_path):
    code, said, err = finished(start("watch", place, "-o", tmp_path / "out", "--once"))

    assert (code, said) == (0, "")
    assert err.startswith("0 logs done; ")


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (("misspelt", "-o", "out"), "there is no such folder"),
        ((".", "-o", "out"), "lies in the folder that is watched"),
        (("file://{here}", "-o", "out"), "lies in the folder that is watched"),
        (("in", "-o", "out", "--recipe", "{bench}"), "it is no gate"),
        (("in", "-o", "out", "--on-finished", "'"), "--on-finished: No closing quotation"),
        (("in", "-o", "out", "--on-finished", " "), "--on-finished has no command"),
        (("in", "-o", "out", "--workers", "0"), "0 workers do no work"),
        (("in", "-o", "out", "--every", "nan"), "--every"),
        (("in", "-o", "out", "--give-up", "inf"), "--give-up inf is no time to wait"),
    ],
)
def test_what_makes_no_sense_gets_one_line(place, tmp_path, options, line, monkeypatch, capsys):
    from slamreplay.cli.main import run

    monkeypatch.chdir(tmp_path)
    options = [text.format(here=tmp_path, bench=BENCH) for text in options]
    monkeypatch.setattr("sys.argv", ["slamreplay", "watch", *options])

    assert run() == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert line in said
