"""What the terminal shows: no cut words, no colours unasked for, nothing of a log obeyed."""

import json
import os
import re
import subprocess
import sys
import unicodedata
from io import StringIO
from pathlib import Path

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len

from slamreplay.bundle.manifest import Loss, Role, Source
from slamreplay.bundle.store import write_bundle
from slamreplay.cli import main
from slamreplay.cli.columns import folded, in_columns
from slamreplay.cli.progress import progress_bar
from slamreplay.cli.terminal import safe, say_labelled
from slamreplay.testing.synthetic import room_grid, synthetic_bundle

PROGRAM = [str(Path(sys.executable).with_name("slamreplay"))]
HOSTILE = "/scan\x1b[2J\x9b31m\x1b]0;owned\x07[red]x[/red]\u202egnp\r\nsecond ±²—ж"


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A bundle in which a topic, a file and a loss have names that terminals would obey."""
    bundle = synthetic_bundle(seconds=6.0, belief_offset_xyyaw=(1.5, 0.5, 0.1))
    names = ("scans", "odometry", "transforms", "poses", "initial_poses", "references")
    roles = [
        Role(
            role=r.role,
            topic=HOSTILE if r.role == "initial_pose" else r.topic,
            type=r.type,
            messages=r.messages,
            reason=f"{r.reason}; {HOSTILE}" if r.role == "initial_pose" else r.reason,
        )
        for r in bundle.manifest.roles
    ]
    manifest = bundle.manifest.model_copy(
        update={
            "roles": roles,
            "sources": [Source(name=HOSTILE, format="mcap", bytes=1, sha256="0" * 64)],
            "losses": [Loss(kind="lost", what=HOSTILE, count=3, reason=HOSTILE)],
        }
    )
    target = tmp_path_factory.mktemp("terminal") / "b.bundle"
    write_bundle(target, manifest, {n: bundle.table(n) for n in names}, {"room": room_grid()})
    return target


def run(*arguments, **env):
    """The program in a pipe; what is not given in `env` is what the tests were started with."""
    whole = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "NO_COLOR", "FORCE_COLOR")}
    done = subprocess.run(
        [*PROGRAM, *map(str, arguments)], capture_output=True, env=whole | env, timeout=120
    )
    assert done.returncode == 0, done.stderr.decode(errors="replace")
    return done.stdout


def on_a_terminal(*arguments, columns, **env):
    """The same on a terminal of so many columns."""
    pty = pytest.importorskip("pty")
    import fcntl
    import struct
    import termios

    whole = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "NO_COLOR", "FORCE_COLOR")}
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
    program = subprocess.Popen(
        [*PROGRAM, *map(str, arguments)],
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        env=whole | {"TERM": "xterm-256color"} | env,
    )
    os.close(theirs)
    parts = []
    while True:
        try:
            part = os.read(ours, 65536)
        except OSError:  # the program has gone
            break
        if not part:
            break
        parts.append(part)
    os.close(ours)
    assert program.wait(60) == 0
    return b"".join(parts).decode().replace("\r\n", "\n")


def words_of(text):
    return re.sub(r"\x1b\[[0-9;]*m", "", text).split()


COMMANDS = [
    ("explain", "SR-LOC-005"),
    ("list", "perturbations"),
    ("inspect", "BUNDLE"),
]


#: What a table that became blocks does without: names of its first columns, unknown numbers.
HEADS = {"role", "topic", "table", "kind", "part", "version", "drift", "ppm", "-"}


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_narrow_terminals_cut_no_word_and_wide_ones_do_not_spread(folder, command):
    command = [folder if word == "BUNDLE" else word for word in command]
    plain = run(*command).decode()
    for columns, widest in ((50, 50), (200, 120)):
        text = run(*command, COLUMNS=str(columns)).decode()
        for line in text.splitlines():
            assert cell_len(line) <= widest or len(line.split()) == 1, line
        assert set(words_of(plain)) - set(words_of(text)) <= HEADS


def test_a_pipe_has_one_line_for_each_thing(folder):
    text = run("inspect", folder).decode()
    (told,) = (line for line in text.splitlines() if line.startswith("  initial_pose "))

    assert len(told) > 120
    assert len(run("list", "findings").decode().splitlines()) == len(
        json.loads(run("list", "findings", "--json"))
    )


def test_a_terminal_gets_colours_and_folded_lines(folder):
    text = on_a_terminal("inspect", folder, columns=70)

    assert "\x1b[1m" in text
    assert max(map(cell_len, re.sub(r"\x1b\[[0-9;]*m", "", text).splitlines())) <= 70


@pytest.mark.parametrize(
    ("env", "coloured"),
    [
        ({}, False),
        ({"FORCE_COLOR": "1"}, True),
        ({"FORCE_COLOR": "1", "NO_COLOR": "1"}, False),
        ({"FORCE_COLOR": "1", "TERM": "dumb"}, False),
    ],
)
def test_colour_in_a_pipe_only_where_it_is_asked_for(env, coloured):
    assert (b"\x1b[" in run("explain", "SR-LOC-001", **{"TERM": "xterm", **env})) == coloured


@pytest.mark.parametrize("env", [{"NO_COLOR": "1"}, {"TERM": "dumb"}])
def test_no_control_character_reaches_a_terminal_that_wants_none(request, env):
    log = request.config.rootpath / "sample_logs" / "healthy_short.bag"
    shown = on_a_terminal("inspect", log, columns=80, **env)

    # NO_COLOR is about colours: the progress bar may still move the cursor.
    assert not re.search(r"\x1b\[[0-9;]*m" if "NO_COLOR" in env else "\x1b", shown)
    assert "What is there" in shown
    assert "\x1b" not in on_a_terminal("explain", "SR-LOC-001", columns=80, **env)


def test_texts_of_a_log_are_neither_obeyed_nor_read_as_markup(folder):
    text = on_a_terminal("inspect", folder, columns=100)
    rest = re.sub(r"\x1b\[[0-9;]*m", "", text)  # our own colours

    assert not [c for c in rest if c != "\n" and unicodedata.category(c) in ("Cc", "Cf")]
    assert not re.search(r"\x1b\[3[0-7]m[^\x1b]*x\x1b", text)
    assert "[red]x[/red]" in rest
    assert r"\x1b[2J\x9b31m\x1b]0;owned\x07" in rest


def test_texts_of_a_fault_are_not_obeyed():
    done = subprocess.run([*PROGRAM, "inspect", HOSTILE], capture_output=True, timeout=60)

    assert done.returncode == 2
    assert b"\x1b" not in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("colour", [{}, {"FORCE_COLOR": "1", "TERM": "xterm"}], ids=["", "colour"])
def test_an_output_that_lacks_characters_gets_plainer_ones(folder, colour):
    told = run("inspect", folder, PYTHONIOENCODING="cp1252", PYTHONUTF8="0", **colour)

    assert "second ±²—".encode("cp1252") + rb"\u0436" in told


def test_json_is_utf_8_whatever_the_terminals_encoding(folder):
    answers = json.loads(run("inspect", folder, "--json", PYTHONIOENCODING="ascii"))

    assert answers["bundle"]["sources"][0]["name"] == HOSTILE


def test_every_command_has_json():
    def leaves(command):
        below = getattr(command, "commands", None)
        return [command] if below is None else [x for c in below.values() for x in leaves(c)]

    for name in main.COMMANDS:
        program = typer.Typer()
        __import__(f"slamreplay.cli.{name}", fromlist=["register"]).register(program)
        for command in leaves(typer.main.get_command(program)):
            assert any("--json" in p.opts for p in command.params), command.name


def test_a_progress_bar_takes_no_markup_and_no_escape_of_a_log(monkeypatch):
    class Terminal(StringIO):
        def isatty(self):
            return True

    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stderr", Terminal())
    with progress_bar("reading") as progress:
        progress("[red]x[/red]\x1b]0;owned\x07", 0.5)
    shown = sys.stderr.getvalue()

    assert "[red]x[/red]\\x1b]0;owned" in shown
    assert "\x1b]" not in shown


TEXT = st.lists(st.text("ab", min_size=1, max_size=12), max_size=12).map(" ".join)


@given(text=TEXT, width=st.integers(1, 40), indent=st.integers(0, 6))
def test_folding_keeps_every_word(text, width, indent):
    lines = folded(text, width, indent)

    assert " ".join(lines).split() == text.split()
    for line in lines:
        assert len(line) <= width or len(line.split()) == 1


@given(
    rows=st.integers(1, 4).flatmap(
        lambda columns: st.lists(
            st.lists(TEXT, min_size=columns, max_size=columns), min_size=2, max_size=5
        )
    ),
    width=st.one_of(st.none(), st.integers(12, 80)),
    numbers=st.sets(st.integers(1, 3)),
)
def test_tables_keep_every_word_at_any_width(rows, width, numbers):
    shown = [
        "".join(text for text, _ in line)
        for line in in_columns(rows, width=width, numbers=numbers & set(range(len(rows[0]))))
    ]

    if width is None:
        assert len(shown) == len(rows)
    else:
        assert all(len(line) <= width or len(line.split()) <= 2 for line in shown)
    told = " ".join(shown).split()
    for row in rows[1:]:
        for word in " ".join(row).split():
            assert word in told


def test_a_number_and_its_unit_stay_together():
    assert folded("it was 7.0 m off", 9) == ["it was", "7.0 m off"]
    assert folded("it was 7.0 m off", 8) == ["it was", "7.0 m", "off"]


def test_an_alarm_is_told_by_more_than_a_colour(capsys):
    say_labelled("belief", "7 m off", "bad", column=8)
    say_labelled("beams", "fine", "plain", column=8)

    assert capsys.readouterr().out == "! belief  7 m off\n  beams   fine\n"


def test_what_is_safe_reads_as_it_was():
    assert safe("x [b] ±") == "x [b] ±"
    assert safe("a\tb\nc\x00\x85\u2066") == "a b c\\x00\\x85\\u2066"
