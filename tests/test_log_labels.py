"""What a log says of itself beside its messages, in every container that can hold it."""

import io
import json
from dataclasses import replace
from pathlib import Path

import pytest

from slamreplay.batch.keys import task_of
from slamreplay.batch.labels import labels_of
from slamreplay.batch.sources import sources_of
from slamreplay.batch.worker import look_back
from slamreplay.cli.simulate import _simulate
from slamreplay.errors import OutputError, UsageError
from slamreplay.ingest.labels import log_labels
from slamreplay.simulate import pipeline
from slamreplay.simulate.topics import Record
from slamreplay.simulate.writer import write_log

SAMPLES = Path(__file__).resolve().parents[1] / "sample_logs"
LABELS = {"robot": "amr-07", "site": "north: hall 2", "software": "2.3.1", "shift": "#3"}


def _write(path, labels=LABELS):
    def two(messages):
        text = messages.make("std_msgs/String", data="x")
        return [Record(t, "/a", "std_msgs/String", text) for t in (1, 2)]

    write_log(path, two, labels=labels)
    return path


@pytest.mark.parametrize("name", ["a.mcap", "a.db3", "folder"])
def test_labels_are_read_back_from_what_simulate_writes(tmp_path, name):
    assert log_labels(_write(tmp_path / name)) == LABELS
    assert log_labels(_write(tmp_path / f"b{name}", {})) == {}


def test_labels_of_a_folder_hold_without_its_metadata_and_in_its_only_file(tmp_path):
    folder = _write(tmp_path / "folder")
    (file,) = folder.glob("*.mcap")
    assert log_labels(file) == LABELS
    (folder / "metadata.yaml").unlink()
    assert log_labels(folder) == LABELS


def test_a_ros1_bag_holds_none(tmp_path):
    with pytest.raises(OutputError, match="a ROS 1 bag holds no labels"):
        _write(tmp_path / "a.bag")
    assert log_labels(SAMPLES / "healthy_short.bag") == {}


def test_what_holds_no_labels_is_told_before_the_work(tmp_path, monkeypatch):
    monkeypatch.setattr(pipeline, "record", None)
    with pytest.raises(OutputError, match="holds no labels"):
        pipeline.simulate("healthy", tmp_path / "a.bag", labels=LABELS)


def _mcap(path, records, *, finish=True, chunks=3):
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=10)
        writer.start()
        channel = writer.register_channel("/a", "json", 0)
        for name, content in records:
            writer.add_metadata(name, content)
        for t in range(chunks):
            writer.add_message(channel, t, b"x" * 20, t)
        if finish:
            writer.finish()
    return path


def test_records_of_other_programs_count_where_their_keys_mean_something(tmp_path):
    path = _mcap(tmp_path / "a.mcap", [
        ("recorder", {"hostname": "box", "swVersion": "9", "colour": "red"}),
        ("run", {"Robot ID": "7", "Site": " south\n"}),
    ])  # fmt: skip
    assert log_labels(path) == {"robot": "7", "site": "south", "software": "9"}


def test_our_record_holds_against_others_and_the_first_against_later_ones(tmp_path):
    path = _mcap(tmp_path / "a.mcap", [
        ("info", {"robot": "other", "version": "1"}),
        ("slamreplay.labels", {"vehicle_id": "mine", "owner": "me"}),
        ("info", {"version": "2"}),
    ])  # fmt: skip
    expected = {"owner": "me", "robot": "mine", "software": "1", "vehicle_id": "mine"}
    assert log_labels(path) == expected


def test_a_log_that_was_cut_is_passed_over_by_its_heads(tmp_path):
    path = _mcap(tmp_path / "a.mcap", [("slamreplay.labels", {"site": "n"})], finish=False)
    assert log_labels(path) == {"site": "n"}
    content = path.read_bytes()
    for cut in range(0, len(content), 7):
        path.write_bytes(content[:cut])
        assert log_labels(path) in ({}, {"site": "n"})


def test_an_index_that_leads_nowhere_costs_no_other_record(tmp_path):
    path = _mcap(tmp_path / "a.mcap", [("first", {"site": "n"}), ("info", {"robot": "7"})])
    content = path.read_bytes()
    at = content.index(b"\x0d" + (16 + 4 + len("first")).to_bytes(8, "little")) + 9
    content = content[:at] + b"\xff" * 8 + content[at + 8 :]
    content = content[:-12] + bytes(4) + content[-8:]  # no checksum, which would tell
    path.write_bytes(content)
    assert log_labels(path) == {"robot": "7"}


def test_a_closed_log_costs_few_reads_whatever_its_size(tmp_path, monkeypatch):
    path = _mcap(tmp_path / "a.mcap", [("slamreplay.labels", {"site": "n"})], chunks=500)
    read = []

    class Counted(io.BufferedReader):
        def read(self, size=-1):
            read.append(size)
            return super().read(size)

    monkeypatch.setattr(Path, "open", lambda self, *_args: Counted(io.FileIO(self)))
    assert log_labels(path) == {"site": "n"}
    assert len(read) < 10


@pytest.mark.parametrize(
    "text",
    [
        "", "custom_data:", "custom_data: [", "custom_data: {a: &x [*x]}", "custom_data: 3",
        "rosbag2_bagfile_information:\n  custom_data: ~\n  site: no\n", "\0",
        "custom_data:\n  ? [a, b]\n  : c\n",
    ],
)  # fmt: skip
def test_metadata_that_makes_no_sense_gives_no_labels(tmp_path, text):
    (tmp_path / "metadata.yaml").write_text(text)
    assert log_labels(tmp_path) == {}


def test_custom_data_is_read_as_text_and_no_further(tmp_path):
    (tmp_path / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  version: 9\n  custom_data:\n    site: 007\n"
        "    software: 2.10\n\n  ros_distro: humble\n  robot: no\n"
    )
    assert log_labels(tmp_path) == {"site": "007", "software": "2.10"}


def test_the_table_holds_against_the_log_and_the_namespace_fills_in(tmp_path):
    path = _write(tmp_path / "a.mcap", {"site": "n", "robot_id": "7"})
    (source,) = sources_of([str(path)])
    assert labels_of(source, path) == {"site": "n", "robot": "7", "robot_id": "7"}
    said = replace(source, labels={"vehicle": "9"}, robot="/tb3")
    assert labels_of(said, path)["robot"] == "9"
    alone = replace(source, robot="/tb3")
    assert labels_of(alone, SAMPLES / "healthy_short.bag")["robot"] == "tb3"


def test_a_log_that_cannot_be_judged_bears_its_labels_all_the_same(tmp_path):
    (source,) = sources_of([str(_write(tmp_path / "a.mcap"))])
    result = look_back(task_of(replace(source, labels={"site": "told"})), tmp_path)
    assert result.error is not None
    (row,) = result.tables["logs"].to_pylist()
    assert (row["site"], row["robot"], row["software"]) == ("told", "amr-07", "2.3.1")


def test_the_command_takes_labels_and_refuses_what_are_none(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(
        pipeline, "simulate", lambda _scenario, target, *, seed, labels: _write(target, labels)
    )
    log = tmp_path / "a.mcap"
    _simulate("healthy", log, 1, samples=False, labels=["site=north", "robot=amr=07"], as_json=True)
    assert json.loads(capsys.readouterr().out)["labels"] == {"site": "north", "robot": "amr=07"}
    assert log_labels(log) == {"site": "north", "robot": "amr=07"}
    for wrong in (["site"], ["Site=a"], ["site="], ["=a"], ["site=a\n"], ["site=a", "site=b"]):
        with pytest.raises(UsageError, match="--label"):
            _simulate("healthy", log, 1, samples=False, labels=wrong)
    with pytest.raises(UsageError, match="sample logs take no --label"):
        _simulate(None, log, None, samples=True, labels=["site=a"])
