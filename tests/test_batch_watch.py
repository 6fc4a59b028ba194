"""A watched folder: nothing is picked half-written, nothing is lost, nothing is done twice."""

import errno
import os
import shutil
import struct
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import slamreplay.batch.watch as watched
from slamreplay.batch.complete import Completeness
from slamreplay.batch.keys import task_of
from slamreplay.batch.put_off import is_passing
from slamreplay.batch.settling import Patience, Settling
from slamreplay.batch.sources import NoLogError, sources_of
from slamreplay.batch.stores import store_error
from slamreplay.batch.task import LogResult
from slamreplay.batch.watch import Pace, Tally, watch
from slamreplay.batch.whole import completeness
from slamreplay.errors import LogError, OutputError
from slamreplay.fleet.schema import arrow_schema
from slamreplay.fleet.store import read

MAGIC = b"\x89MCAP0\r\n"
METADATA = "rosbag2_bagfile_information: {relative_file_paths: [run_0.mcap]}\n"


def mcap(seed=0, size=200):
    """What every reader takes for the outside of a closed file."""
    return MAGIC + bytes([seed]) * size + b"\x02" + struct.pack("<Q", 20) + bytes(20) + MAGIC


@dataclass
class Bench:
    """A watch whose clock runs only while it sleeps, and whose looking back takes no time.

    `steps` are what happens in the folder, one before each look but the first; when there are no
    more, somebody presses Ctrl-C. `read` are the bytes that were looked back on, by log.
    """

    folder: Path
    out: Path
    steps: list = field(default_factory=list)
    patience: Patience = field(default_factory=Patience)
    pace: Pace = field(default_factory=lambda: Pace(every_s=5.0))
    now_s: float = 1000.0
    wall_s: float = 0.0
    told: list = field(default_factory=list)
    finished: list = field(default_factory=list)
    read: list = field(default_factory=list)
    pages: int = 0
    fails_at: int = 0
    tally: Tally = field(default_factory=Tally)
    error_of: dict = field(default_factory=dict)
    while_reading: dict = field(default_factory=dict)
    gate: str | None = None

    def sleep(self, seconds):
        self.now_s += seconds
        if not self.steps:
            raise KeyboardInterrupt
        step = self.steps.pop(0)
        if step is not None:
            step()

    def find(self):
        if not self.folder.is_dir():
            raise LogError("there is no such folder", where=self.folder)
        try:
            return sources_of([str(self.folder)])
        except NoLogError:
            return []

    @contextmanager
    def serve(self, scratch):
        assert scratch.is_dir()
        yield self.look_back

    def look_back(self, tasks):
        for task in tasks:
            name = Path(task.source.log).name
            self.read.append((name, Path(task.source.files[0].url).read_bytes()))
            self.while_reading.pop(name, lambda: None)()
            error = self.error_of.get(name)
            row = {"key": task.key, "log": task.source.log, "error": error, "gate": self.gate,
                   "status": "failed" if error else "done", "state": None if error else "healthy",
                   "report": None if error else "logs/x", "summary": "fine"}  # fmt: skip
            table = pa.Table.from_pylist([row], arrow_schema("logs"))
            yield LogResult(task.key, error, {}, {}, {"logs": table})

    def run(self):
        """Until the steps are through."""
        clocks = {"now_s": lambda: self.now_s, "wall_s": lambda: self.wall_s}
        with pytest.raises(KeyboardInterrupt):
            self.run_once(**clocks)

    def run_once(self, **clocks):
        clocks = {"now_s": lambda: self.now_s, "wall_s": lambda: self.wall_s} | clocks
        return watch(
            self.out,
            self.find,
            Settling(self.patience, completeness, **clocks),
            task_of,
            self.serve,
            pace=self.pace,
            tell=self.told.append,
            finished=self.finished.append,
            finish_round=self.page,
            tally=self.tally,
            sleep=self.sleep,
        )

    def page(self):
        self.pages += 1
        if self.pages == self.fails_at:
            raise ValueError("a table that nobody thought of")

    def names(self):
        return [name for name, _ in self.read]

    def rows(self):
        return sorted(Path(row["log"]).name for row in read(self.out, "logs").to_pylist())

    def write(self, name, content):
        """A step."""
        place = self.folder / name

        def step():
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(content)

        return step

    def append(self, name, content):
        def step():
            with (self.folder / name).open("ab") as stream:
                stream.write(content)

        return step


@pytest.fixture
def bench(tmp_path):
    (tmp_path / "in").mkdir()
    return Bench(tmp_path / "in", tmp_path / "out")


WAIT = [None] * 4  # 20 s, twice what a log must stand still


def test_a_log_is_done_once_when_it_stands_still(bench):
    bench.steps = [bench.write("a.mcap", mcap()), *WAIT, *WAIT]

    bench.run()

    assert bench.read == [("a.mcap", mcap())]
    assert bench.rows() == ["a.mcap"]
    assert bench.pages == 1
    (one,) = bench.finished
    assert (Path(one.log).name, one.state, one.has_failed) == ("a.mcap", "healthy", False)


def test_it_must_stand_still_for_long_enough(bench):
    bench.steps = [bench.write("a.mcap", mcap()), None]  # seen at 5 s, looked at again at 10 s

    bench.run()

    assert bench.read == []
    assert bench.tally.moving == 1


@settings(max_examples=25, deadline=None)
@given(
    cuts=st.lists(st.integers(1, len(mcap()) - 1), max_size=6, unique=True),
    waits=st.lists(st.integers(0, 6), min_size=7, max_size=7),
)
def test_a_log_written_in_pieces_is_never_picked_early(tmp_path_factory, cuts, waits):
    """However long its writer pauses, even where nothing but its footer lacks."""
    folder = tmp_path_factory.mktemp("pieces")
    (folder / "in").mkdir()
    bench = Bench(folder / "in", folder / "out")
    ends = [0, *sorted(cuts), len(mcap())]
    for first, last, wait in zip(ends, ends[1:], waits, strict=False):
        bench.steps += [bench.append("a.mcap", mcap()[first:last]), *[None] * wait]
    bench.steps += WAIT

    bench.run()

    assert bench.read == [("a.mcap", mcap())]


def test_a_log_that_is_renamed_into_place(bench):
    bench.steps = [
        bench.write("a.mcap.part", mcap()), *WAIT,
        lambda: (bench.folder / "a.mcap.part").rename(bench.folder / "a.mcap"), *WAIT,
    ]  # fmt: skip
    bench.run()

    assert bench.names() == ["a.mcap"]


def test_a_bag_of_rosbag2_waits_for_its_metadata(bench):
    bench.steps = [
        bench.write("run/run_0.mcap", mcap()), *WAIT, *WAIT,
        bench.write("run/metadata.yaml", METADATA.encode()), *WAIT,
    ]  # fmt: skip
    bench.run()

    assert bench.names() == ["run"]
    assert [line for line in bench.told if "metadata.yaml" in line] == [
        f"{bench.folder / 'run'}: not whole: there is no metadata.yaml yet; waiting for the rest"
    ]


def test_a_format_that_has_no_end_stands_still_for_longer(bench):
    bench.steps = [bench.write("a.clf", b"PARAM x 1\n"), *[None] * 11]
    bench.run()
    assert bench.read == []

    bench.steps = [None] * 12  # its own clock alone tells: for the other one files are of tomorrow
    bench.run()
    assert bench.names() == ["a.clf"]


def test_rounds_go_on_where_the_last_one_ended(bench):
    bench.steps = [
        bench.write("a.mcap", mcap(1)), *WAIT, bench.write("b.mcap", mcap(2)), *WAIT,
    ]  # fmt: skip
    bench.run()

    assert bench.names() == ["a.mcap", "b.mcap"]
    assert bench.pages == 2


def test_a_page_that_fails_is_told_and_made_in_the_next_round(bench):
    bench.fails_at = 1
    bench.steps = [
        bench.write("a.mcap", mcap(1)), *WAIT, bench.write("b.mcap", mcap(2)), *WAIT,
    ]  # fmt: skip
    bench.run()

    assert (bench.names(), bench.pages) == (["a.mcap", "b.mcap"], 2)
    assert "a table that nobody thought of" in bench.told[0]
    assert bench.told[1:] == ["that is over: going on"]


def test_a_log_that_is_replaced_is_done_again(bench):
    bench.steps = [
        bench.write("a.mcap", mcap(1)), *WAIT, bench.write("a.mcap", mcap(2)), *WAIT,
    ]  # fmt: skip
    bench.run()

    assert bench.read == [("a.mcap", mcap(1)), ("a.mcap", mcap(2))]
    assert len({one.key for one in bench.finished}) == 2


def test_one_that_is_only_touched_is_not(bench):
    bench.steps = [
        bench.write("a.mcap", mcap(1)), *WAIT,
        lambda: os.utime(bench.folder / "a.mcap", (1, 1)), *WAIT,
    ]  # fmt: skip
    bench.run()

    assert bench.names() == ["a.mcap"]


def test_a_watch_that_is_killed_between_goes_on(bench):
    for k in range(4):
        bench.write(f"{k}.mcap", mcap(k))()

    def die():
        raise KeyboardInterrupt

    bench.steps = [*WAIT]
    bench.while_reading = {"2.mcap": die}  # 3.mcap, the latest, is kept already
    for k in range(4):
        os.utime(bench.folder / f"{k}.mcap", (100 + k, 100 + k))
    bench.run()
    assert (bench.names(), bench.rows()) == (["3.mcap", "2.mcap"], ["3.mcap"])

    bench.steps, bench.read = [*WAIT], []
    bench.run()
    assert bench.names() == ["2.mcap", "1.mcap", "0.mcap"]
    assert bench.rows() == ["0.mcap", "1.mcap", "2.mcap", "3.mcap"]


def test_what_nobody_closed_is_told_once_and_taken_after_a_while(bench):
    bench.patience = Patience(settle_s=10.0, give_up_s=60.0)
    bench.steps = [bench.write("a.mcap", mcap()[:-30]), *[None] * 10]
    bench.run()
    line = f"{bench.folder / 'a.mcap'}: not whole: it has no footer yet; waiting for the rest"
    assert (bench.read, bench.told) == ([], [line])
    assert list(bench.tally.lacking.values()) == ["it has no footer yet"]

    bench.steps = [None] * 13
    bench.run()
    assert bench.names() == ["a.mcap"]


@pytest.mark.parametrize("state", ["yes", "unknown", "no"])
def test_an_old_date_on_a_file_that_just_came_makes_it_no_older(bench, state):
    bench.write("a.clf", b"x")()  # as a copy keeps the date of what it copies
    os.utime(bench.folder / "a.clf", (100, 100))
    settling = Settling(
        Patience(settle_s=10.0), lambda _source: Completeness(state, "so it says"),
        now_s=lambda: bench.now_s, wall_s=lambda: 1e9,
    )  # fmt: skip

    looked = settling.look(bench.find())
    assert (looked.ready, looked.lacking, looked.moving) == ((), {}, 1)
    bench.now_s += 10.0
    assert settling.look(bench.find()).ready


def test_a_watch_that_is_started_anew_need_not_wait_as_long_again(bench):
    bench.patience = Patience(settle_s=10.0, give_up_s=3600.0)
    bench.write("a.mcap", mcap()[:-30])()
    os.utime(bench.folder / "a.mcap", (1000, 1000))
    bench.wall_s = 1000 + 3600.0
    bench.steps = WAIT[:3]
    bench.run()

    assert bench.names() == ["a.mcap"]


def test_a_folder_that_vanishes_is_waited_for(bench):
    away = bench.folder.with_name("away")
    bench.steps = [
        lambda: bench.folder.rename(away), *WAIT, lambda: away.rename(bench.folder),
        bench.write("a.mcap", mcap()), *WAIT,
    ]  # fmt: skip
    bench.run()

    assert [line.partition(";")[0] for line in bench.told] == [
        f"{bench.folder}: there is no such folder",
        "that is over: going on",
    ]
    assert bench.names() == ["a.mcap"]


def test_a_folder_that_never_was_is_a_fault(bench):
    bench.folder = bench.folder / "misspelt"

    with pytest.raises(LogError, match="no such folder"):
        bench.run_once()


def full(times, keep):
    """A disk that is full so many times."""
    left = [times]

    def write(*arguments):
        if left[0]:
            left[0] -= 1
            raise OutputError("cannot write: No space left on device", where="out")
        keep(*arguments)

    return write


def test_a_full_disk_is_told_once_and_nothing_is_done_again(bench, monkeypatch):
    monkeypatch.setattr(watched, "commit_result", full(3, watched.commit_result))
    bench.steps = [bench.write("a.mcap", mcap()), *WAIT, *WAIT]

    bench.run()

    assert bench.told == [
        "out: cannot write: No space left on device; trying again every 5 s",
        "that is over: going on",
    ]
    assert (bench.names(), bench.rows()) == (["a.mcap"], ["a.mcap"])


def test_what_a_worker_lacked_is_tried_again_ever_later(bench):
    line = f"cannot write: {os.strerror(errno.ENOSPC)}"
    bench.error_of = {"a.mcap": line}
    bench.steps = [
        bench.write("a.mcap", mcap()), *[None] * 18, bench.error_of.clear, *[None] * 40,
    ]  # fmt: skip
    bench.run()

    assert bench.names() == ["a.mcap"] * 6  # after 5, 10, 20, 40 and 80 s
    assert bench.rows() == ["a.mcap"]
    assert [one.has_failed for one in bench.finished] == [False]
    assert len([told for told in bench.told if line in told]) == 1
    assert bench.tally.lacking == {}


def test_what_waits_for_another_trial_is_told_at_the_end(bench):
    line = f"cannot write: {os.strerror(errno.ENOSPC)}"
    bench.error_of = {"a.mcap": line}
    bench.steps = [bench.write("a.mcap", mcap()), *[None] * 7]  # two trials, and looks between
    bench.run()
    assert (bench.names(), bench.tally.lacking) == (
        ["a.mcap"] * 3, {str(bench.folder / "a.mcap"): line},
    )  # fmt: skip


def test_of_what_vanished_before_another_trial_nothing_is_left(bench):
    bench.error_of = {"a.mcap": f"cannot write: {os.strerror(errno.ENOSPC)}"}
    bench.steps = [
        bench.write("a.mcap", mcap()), *WAIT, (bench.folder / "a.mcap").unlink, None,
    ]  # fmt: skip
    bench.run()

    assert bench.tally.lacking == {}
    assert bench.rows() == []


@pytest.mark.parametrize(
    ("fault", "passes"),
    [
        (TimeoutError(), True),
        (PermissionError(), True),
        (OSError(errno.ENOSPC, "full"), True),
        (FileNotFoundError(), False),
    ],
)
def test_which_faults_of_a_store_pass(fault, passes):
    assert is_passing(str(store_error(fault, "s3://bucket/a.mcap", {}))) == passes


def test_a_log_that_cannot_be_read_is_done_once(bench):
    bench.error_of = {"a.mcap": "a.mcap: not a log"}
    bench.steps = [bench.write("a.mcap", mcap()), *WAIT, *WAIT]
    bench.run()

    assert bench.names() == ["a.mcap"]
    assert (bench.tally.finished, bench.tally.failed) == (1, 1)
    assert bench.finished[0].summary == "a.mcap: not a log"


def test_a_log_that_is_written_to_while_it_is_read_is_done_when_it_stands_still(bench):
    bench.while_reading = {"a.mcap": bench.append("a.mcap", b"more" + mcap())}
    bench.steps = [bench.write("a.mcap", mcap()), *WAIT, *WAIT]
    bench.run()

    assert [content[-8:] for _, content in bench.read] == [MAGIC, MAGIC]
    assert len(bench.rows()) == 1
    assert bench.told == [
        f"{bench.folder / 'a.mcap'}: changed while it was read, so it waits again"
    ]


def test_a_log_that_was_gone_before_it_was_read_has_not_failed(bench):
    bench.error_of = {"a.mcap": "a.mcap: cannot read: No such file or directory"}
    bench.while_reading = {"a.mcap": lambda: (bench.folder / "a.mcap").unlink()}
    bench.steps = [bench.write("a.mcap", mcap()), *WAIT]
    bench.run()

    assert (bench.names(), bench.rows(), bench.tally.failed) == (["a.mcap"], [], 0)


def test_a_log_that_was_read_and_then_filed_away_is_kept(bench):
    bench.while_reading = {"a.mcap": lambda: (bench.folder / "a.mcap").unlink()}
    bench.steps = [bench.write("a.mcap", mcap()), *WAIT]
    bench.run()

    assert bench.rows() == ["a.mcap"]


def test_the_latest_come_first_and_new_ones_before_the_rest(bench):
    bench.pace = Pace(every_s=5.0, per_round=2)
    for k in range(5):
        bench.write(f"{k}.mcap", mcap(k))()
        os.utime(bench.folder / f"{k}.mcap", (100 + k, 100 + k))
    bench.steps = [*WAIT]
    bench.run()

    assert bench.names() == ["4.mcap", "3.mcap", "2.mcap", "1.mcap", "0.mcap"]
    assert bench.pages == 3


def test_once_waits_for_one_look_more_and_ends(bench):
    bench.pace = Pace(every_s=5.0, per_round=2, is_once=True)
    bench.gate = "failed"
    for k in range(3):
        bench.write(f"{k}.mcap", mcap(k))()
    bench.write("cut.mcap", mcap()[:-30])()
    bench.steps = [bench.append("late.mcap", mcap(9))]

    tally = bench.run_once()

    assert sorted(bench.names()) == ["0.mcap", "1.mcap", "2.mcap"]
    assert (tally.finished, tally.gate_failed, tally.moving) == (3, 3, 1)
    assert list(tally.lacking.values()) == ["it has no footer yet"]


def test_once_tells_that_the_disk_is_full_and_ends(bench, monkeypatch):
    monkeypatch.setattr(watched, "commit_result", full(1, watched.commit_result))
    bench.pace = Pace(is_once=True)
    bench.write("a.mcap", mcap())()
    bench.steps = [None]

    with pytest.raises(OutputError):
        bench.run_once()


def test_a_log_whose_map_is_missing_waits_for_it(bench):
    missing = [LogError("the map is missing", where="m.yaml")] * 2

    def of(source):
        if missing:
            raise missing.pop()
        return task_of(source)

    bench.steps = [bench.write("a.mcap", mcap()), *WAIT, *WAIT]
    with pytest.raises(KeyboardInterrupt):
        watch(
            bench.out, bench.find, Settling(bench.patience, completeness,
            now_s=lambda: bench.now_s, wall_s=lambda: 0.0), of, bench.serve, pace=bench.pace,
            tell=bench.told.append, finished=bench.finished.append, sleep=bench.sleep,
        )  # fmt: skip

    assert bench.names() == ["a.mcap"]
    assert bench.told == [
        f"{bench.folder / 'a.mcap'}: m.yaml: the map is missing; trying it again later"
    ]


def test_a_store_elsewhere_is_asked_what_it_can_tell():
    def source(url, name, folder=""):
        file = SimpleNamespace(url=url, name=name, size=3, version="1")
        return SimpleNamespace(files=(file,), folder=folder, log=url)

    assert completeness(source("s3://b/a.mcap", "a.mcap")).state == "yes"
    assert completeness(source("https://h/a.mcap", "a.mcap")).state == "unknown"
    assert completeness(source("s3://b/run/run_0.mcap", "run_0.mcap", "run")).state == "no"


def test_nothing_is_left_in_the_folder(bench):
    bench.steps = [bench.write("a.mcap", mcap()), *WAIT]
    bench.run()

    assert not (bench.out / ".scratch").exists()
    shutil.rmtree(bench.out)
