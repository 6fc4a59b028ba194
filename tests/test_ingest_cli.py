"""The commands ingest and inspect: data on stdout, one line for what the user can mend."""

import json
import shutil
import subprocess
import sys

import pytest
import typer
from typer.testing import CliRunner

from slamreplay.cli import ingest, inspect
from slamreplay.errors import LogError, UsageError
from slamreplay.ingest.bundle_cache import ingest_once
from slamreplay.ingest.options import IngestOptions


def program():
    app = typer.Typer()
    ingest.register(app)
    inspect.register(app)
    return app


def scan_log(logs):
    kind = "sensor_msgs/msg/LaserScan"
    scan = logs.make(kind, header__stamp__sec=5, angle_increment=0.1, range_max=5.0)
    return logs.write("log.mcap", [("/scan", kind, scan, 5 * 10**9)])


def test_ingest_and_inspect_of_log_and_bundle_agree(logs, tmp_path):
    log, bundle = scan_log(logs), tmp_path / "b.bundle"
    run = CliRunner().invoke

    made = run(program(), ["ingest", str(log), "-o", str(bundle), "--json"])
    seen = run(program(), ["inspect", str(bundle), "--json"])
    raw = run(program(), ["inspect", str(log), "--json"])

    assert made.exit_code == 0, made.output
    assert json.loads(seen.stdout) == json.loads(raw.stdout) == json.loads(made.stdout)
    assert json.loads(seen.stdout)["roles"][0]["topic"] == "/scan"


def test_a_name_that_is_no_utf_8_is_said_in_one_line(logs, tmp_path):
    log = scan_log(logs)
    odd = log.with_name("log\udcff.mcap")
    try:
        shutil.copy(log, odd)
    except OSError:
        pytest.skip("this file system takes no such name")

    with pytest.raises(UsageError, match="no UTF-8"):
        ingest_once([odd], tmp_path / "cache", IngestOptions())
    assert not list(tmp_path.glob("cache/*"))


def test_inspect_says_what_cannot_be_judged(logs):
    result = CliRunner().invoke(program(), ["inspect", str(scan_log(logs))])

    assert result.exit_code == 0, result.output
    assert "Missing of the eight parts: 7" in result.stdout
    assert "cannot be judged" in result.stdout
    assert "Log time minus header stamp" in result.stdout


def test_a_text_file_raises_the_one_line(tmp_path):
    (tmp_path / "notes.bag").write_text("hello")

    result = CliRunner().invoke(program(), ["inspect", str(tmp_path / "notes.bag")])

    assert isinstance(result.exception, LogError)


def test_commands_import_nothing_heavy():
    code = (
        "import sys, slamreplay.cli.ingest, slamreplay.cli.inspect, slamreplay.ingest;"
        "heavy = {'numpy', 'pandas', 'pyarrow', 'rosbags', 'mcap', 'numba', 'rich.table'};"
        "sys.exit(', '.join(heavy & set(sys.modules)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
