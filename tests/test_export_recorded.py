"""`export --to mcap --only recorded`: the evidence as a ROS 2 log that says the same."""

import json
from pathlib import Path

import numpy as np
import pytest
import typer
import yaml
from export_logs import differences, everything
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from PIL import Image
from rosbags.highlevel import AnyReader
from typer.testing import CliRunner

from slamreplay.cli import export
from slamreplay.export.formats import Format
from slamreplay.export.writers import Request, window_of, write_export
from slamreplay.ingest.pipeline import ingest
from slamreplay.maps.map_server import read_map

ROOT = Path(__file__).resolve().parents[1]
SAMPLE = ROOT / "sample_logs" / "healthy_short.bag"


@pytest.fixture(scope="module")
def sample(tmp_path_factory):
    """A log of ROS 1 as a bundle."""
    return ingest([SAMPLE], tmp_path_factory.mktemp("sample") / "b")


def cut(bundle, folder, start_s=None, end_s=None):
    """The folder of an export, what it said, and its log as a bundle again."""
    request = Request(bundle, window=window_of(bundle, start_s, end_s))
    written = write_export(request, Format.MCAP, folder / "cut")
    again = ingest([folder / "cut" / "recorded.mcap"], folder / "again")
    return folder / "cut", written, again, request.window


def test_a_whole_log_of_ros_1_becomes_the_same_bundle(sample, tmp_path):
    folder, written, again, _ = cut(sample, tmp_path)

    assert differences(sample, again) == []
    assert written.files == ["map.pgm", "map.yaml", "recorded.mcap"]
    assert not written.not_as_recorded
    assert {r.role: r.topic for r in again.manifest.roles} == {
        r.role: r.topic for r in sample.manifest.roles
    }
    np.testing.assert_array_equal(
        again.table("scans")["ranges_m"].values.view(np.uint32),
        sample.table("scans")["ranges_m"].values.view(np.uint32),
    )
    assert again.manifest.maps[0].version == sample.manifest.maps[0].version
    warnings = []
    grid = read_map(folder / "map.yaml", warn=warnings.append)
    assert (grid.occupied == sample.grid().occupied).all()
    assert not warnings
    with Image.open(folder / "map.pgm") as image:
        assert image.size == sample.grid().cells.shape[::-1]
    assert yaml.safe_load((folder / "map.yaml").read_text())["mode"] == "trinary"


def test_something_of_every_kind_comes_back(logs, tmp_path):
    bundle = ingest([everything(logs)], tmp_path / "b")
    filled = {n for n in bundle.manifest.tables if len(bundle.table(n))}
    assert filled >= {"odometry", "imu", "scans", "poses", "initial_poses", "particles", "health",
                      "transforms", "costmaps", "costmap_updates", "plans", "commands", "joints",
                      "recoveries", "references", "signals", "map_updates"}  # fmt: skip
    _, written, again, _ = cut(bundle, tmp_path)
    assert differences(bundle, again) == []
    assert not written.not_as_recorded


@settings(max_examples=4, deadline=None, phases=[Phase.generate])
@given(start=st.floats(0.0, 12.0), length=st.floats(2.0, 6.0))
def test_within_any_window_the_tables_are_the_same(sample, tmp_path_factory, start, length):
    folder = tmp_path_factory.mktemp("window")
    _, _, again, window = cut(sample, folder, start, start + length)
    # Commands have no stamp of their own: where they lie is told by the clock's knots nearby.
    odd = [d for d in differences(sample, again, window) if d != "commands.t_ns"]
    assert odd == []
    late = again.table("commands").t_ns - again.table("commands")["t_log_ns"]
    assert np.ptp(late) < 5_000_000
    for table in ("scans", "odometry", "imu"):
        assert window.holds(again.table(table).t_ns).all()


def test_what_holds_is_carried_into_the_window(sample, tmp_path):
    folder, _, again, window = cut(sample, tmp_path, 8.0, 12.0)

    first, topics = [], {}
    with (folder / "recorded.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            first.append((message.log_time, channel.topic, decoded))
            topics[channel.topic] = channel.metadata["offered_qos_profiles"]
        assert reader.get_header().profile == "ros2"
        (bag,) = reader.iter_metadata()
        assert (bag.name, bag.metadata) == ("rosbag2", {"serialized_metadata": ""})
    start = first[0][0]
    held = {topic for t, topic, _ in first if t == start}
    assert {"/tf_static", "/map", "/tf"} <= held
    assert again.table("poses").t_ns.min() < window.start_ns
    assert {t for t, *_ in first[:2]} == {start}
    assert {topic for _, topic, _ in first[:2]} == {"/tf_static", "/map"}  # before all others
    assert first[-1][0] - start < 5_000_000_000  # a player does not wait for them
    latched = {t for t, qos in topics.items() if yaml.safe_load(qos)[0]["durability"] == 1}
    assert latched == {"/tf_static", "/map"}

    tf = again.table("transforms")
    for parent, child in (("map", "odom"), ("odom", "base_link")):
        t_ns = tf.t_ns[(tf["parent_frame"] == parent) & (tf["child_frame"] == child)]
        assert t_ns.min() < window.start_ns
        assert t_ns.max() > window.end_ns
    whole = sample.table("transforms")
    before = whole.take((whole["parent_frame"] == "map") & (whole.t_ns < window.start_ns))
    assert before.t_ns.max() in tf.t_ns  # the last word of the localizer
    view, again_view = sample.view(), again.view()
    scans = again.table("scans").t_ns
    at_edges = scans[[0, -1]]
    there, known = again_view.transforms.lookup("odom", "base_link", at_edges)
    assert known.all()
    np.testing.assert_allclose(there, view.transforms.lookup("odom", "base_link", at_edges)[0])


def test_readers_of_others_read_every_message(sample, tmp_path):
    folder, *_ = cut(sample, tmp_path, 3.0, 9.0)
    with AnyReader([folder / "recorded.mcap"]) as reader:
        counts = {}
        for connection, t_ns, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            counts[connection.topic] = counts.get(connection.topic, 0) + 1
            if connection.topic == "/scan":
                assert len(message.ranges) > 100
                assert message.angle_max > message.angle_min
                assert 0 < t_ns - message.header.stamp.sec * 10**9 < 2 * 10**9
    with (folder / "recorded.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        others = {}
        for _, channel, _, _ in reader.iter_decoded_messages():
            others[channel.topic] = others.get(channel.topic, 0) + 1
    assert counts == others
    assert counts["/scan"] == 61


def test_the_same_cut_is_the_same_bytes(sample, tmp_path):
    for name in "ab":
        write_export(Request(sample, window=window_of(sample, 1, 3)), Format.MCAP, tmp_path / name)
    for file in (tmp_path / "a").iterdir():
        assert file.read_bytes() == (tmp_path / "b" / file.name).read_bytes()


def test_a_text_log_becomes_ros_2(tmp_path):
    lines = [
        f"ODOM {0.1 * k:.2f} 0 0 0.5 0 0 {k * 0.1:.3f} host {k * 0.1:.3f}\n"
        f"FLASER 4 1.0 2.0 3.0 81.83 {0.1 * k:.2f} 0 0 {0.1 * k:.2f} 0 0 {k * 0.1:.3f} host "
        f"{k * 0.1:.3f}\n"
        for k in range(1, 40)
    ]
    (tmp_path / "log.clf").write_text("".join(lines))
    bundle = ingest([tmp_path / "log.clf"], tmp_path / "b")
    _, _, again, _ = cut(bundle, tmp_path)
    assert again.manifest.topic_of("scan") == "/FLASER"
    np.testing.assert_array_equal(
        again.table("scans")["ranges_m"].values, bundle.table("scans")["ranges_m"].values
    )
    np.testing.assert_array_equal(again.table("odometry").t_ns, bundle.table("odometry").t_ns)


def test_what_no_message_tells_is_said(sample, tmp_path):
    commands = sample.table("commands")
    turn = commands["angular_velocity_xyz"].copy()
    turn[:5, 2] = np.nan
    tables = {n: sample.table(n) for n in sample.manifest.tables}
    tables["commands"] = commands.replace(angular_velocity_xyz=turn)
    steered = type(sample)(sample.manifest, tables, sample.grids())
    written = write_export(Request(steered), Format.MCAP, tmp_path / "x")
    (one,) = written.not_as_recorded
    assert (one.what, one.count) == ("/cmd_vel", 5)
    assert json.loads((tmp_path / "x" / "export.json").read_text())["not_as_recorded"] == [
        vars(one)
    ]


def test_the_command_lists_its_files_and_needs_no_post_mortem(tmp_path, monkeypatch):
    monkeypatch.setattr("slamreplay.postmortem.postmortem", None)  # it would take seconds
    more = ["--to", "mcap", "--only", "recorded", "--start", "2", "--end", "4", "--json"]
    app = typer.Typer()
    export.register(app)
    ran = CliRunner().invoke(app, [str(SAMPLE), "-o", str(tmp_path / "x"), *more])
    assert ran.exit_code == 0, ran.output
    assert json.loads(ran.stdout)["files"] == ["map.pgm", "map.yaml", "recorded.mcap"]


@pytest.mark.parametrize(
    ("log", "start_s", "end_s"),
    [
        ("inesctec_jarvis/jarvis_circular_path_fast.bag", 5.0, 12.0),
        ("olin_neato/ac109_3_demo.bag", 10.0, 20.0),
        ("evo_nav2/nav2_turtlebot.mcap", 20.0, 60.0),
    ],
)
def test_real_logs_can_be_cut(real_logs, tmp_path, log, start_s, end_s):
    bundle = ingest([real_logs / log], tmp_path / "b")
    folder, _, again, window = cut(bundle, tmp_path, start_s, end_s)
    scans, whole = again.table("scans"), bundle.table("scans")
    whole = whole.take(window.holds(whole.t_ns))
    scans = scans.take(window.holds(scans.t_ns))
    np.testing.assert_array_equal(scans["t_sensor_ns"], whole["t_sensor_ns"])
    np.testing.assert_array_equal(scans["ranges_m"].values, whole["ranges_m"].values)
    assert again.manifest.frames.base == bundle.manifest.frames.base
    with AnyReader([folder / "recorded.mcap"]) as reader:
        assert reader.message_count == sum(1 for _ in reader.messages())
        assert reader.duration < (end_s - start_s + 3.0) * 1e9
