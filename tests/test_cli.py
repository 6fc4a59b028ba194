"""The program through its real entry point: start-up cost, faults, exit codes."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from heavy_modules import HEAVY

import slamreplay
from slamreplay.cli import main as cli

PROGRAM = [str(Path(sys.executable).with_name("slamreplay"))]


def run(*arguments, cwd=None, env=None):
    return subprocess.run(
        [*PROGRAM, *arguments], capture_output=True, text=True, cwd=cwd, env=env, timeout=120
    )


def test_help_imports_nothing_heavy():
    code = (
        "import sys; sys.argv = ['slamreplay', '--help']\n"
        "from slamreplay.cli.main import run\n"
        "code = run()\n"
        "import json; print('\\n' + json.dumps([code, sorted(sys.modules)]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)

    code, modules = json.loads(done.stdout.splitlines()[-1])

    assert code == 0
    assert not set(HEAVY) & set(modules)


def test_help_names_every_command():
    text = run("--help").stdout

    for command in ("ingest", "inspect", "perturb", "report", "simulate", "explain", "list"):
        assert f"\n  {command} " in text


@pytest.mark.parametrize("command", ["ingest", "inspect", "perturb", "report", "simulate", "list"])
def test_every_command_has_help(command):
    done = run(command, "--help")

    assert done.returncode == 0
    assert "Usage" in done.stdout


def test_version():
    assert run("--version").stdout == f"slamreplay {slamreplay.__version__}\n"


def test_unknown_command_is_a_usage_error():
    assert "No such command 'replay'" in says_one_line(run("replay"))


def test_missing_argument_is_a_usage_error():
    assert "hint: see slamreplay report --help" in says_one_line(run("report", "-o", "out"))


def test_a_choice_that_is_none_is_named_without_the_parsers_own_words():
    said = says_one_line(run("export", "x", "--to", "foo", "-o", "out"))

    assert "'--to': 'foo' is not one of 'tum'" in said


def test_bare_call_shows_the_help():
    assert "Usage" in run().stdout


def test_fault_of_ours_leaves_a_crash_file(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(sys, "argv", ["slamreplay", "inspect", "x\udcff"])  # as Linux may name it

    def broken(*_, **__):
        raise ZeroDivisionError("boom")

    monkeypatch.setattr(cli, "app", broken)
    monkeypatch.setattr(cli, "COMMANDS", ())

    assert cli.run() == 70
    line = capsys.readouterr().err.strip()
    assert "\n" not in line
    (crash,) = (tmp_path / "slamreplay").iterdir()
    assert crash.name in line
    assert "ZeroDivisionError: boom" in crash.read_text()


def says_one_line(done):
    """The fault in one line on stderr, exit code 2, nothing on stdout."""
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert "Traceback" not in done.stderr
    return done.stderr


def test_text_file_named_bag(tmp_path):
    (tmp_path / "notes.bag").write_text("the robot stopped again\n")

    text = says_one_line(run("report", "notes.bag", "-o", "out", cwd=tmp_path))

    assert "notes.bag" in text
    assert sorted(p.name for p in tmp_path.iterdir()) == ["notes.bag"]


def test_missing_log(tmp_path):
    text = says_one_line(run("ingest", "gone.mcap", "-o", "b", cwd=tmp_path))

    assert "gone.mcap" in text
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a" * 300, "loop", "/dev/null"])
@pytest.mark.parametrize("command", [["inspect"], ["report", "-o", "out"]])
def test_a_name_that_no_log_can_have(tmp_path, name, command):
    (tmp_path / "loop").symlink_to("loop")

    text = says_one_line(run(*command, name, cwd=tmp_path))

    assert name in text
