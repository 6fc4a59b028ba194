"""CARMEN logs: what a line says is in the bundle, what cannot be read is counted."""

import bz2
import gzip
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.tables import Ragged
from slamreplay.errors import LogError, UsageError
from slamreplay.geometry import se2, se3
from slamreplay.hindsight.pipeline import hindsight
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest
from slamreplay.ingest.text_logs import text_log
from slamreplay.ingest.text_logs.carmen import read_carmen
from slamreplay.ingest.text_logs.no_return_code import no_return_code
from slamreplay.maps.map_server import map_files
from slamreplay.maps.raycast import cast_rays
from slamreplay.postmortem import postmortem
from slamreplay.testing.synthetic import room_grid, true_path

IPC = 976_052_857.0


def times(t, ipc=None):
    """The three last fields: ipc time, host, logger's time."""
    return f"{IPC + t if ipc is None else ipc:.6f} nohost {t:.6f}"


def numbers(values, digits=6):
    return " ".join(f"{v:.{digits}f}" for v in values)


def odom(t, xyyaw, velocity=(0.1, 0.2), **more):
    return f"ODOM {numbers(xyyaw)} {numbers(velocity)} 0.0 {times(t, **more)}"


def flaser(t, ranges, robot, laser=None, name="FLASER", **more):
    seat = robot if laser is None else laser
    head = f"{name} {len(ranges)} {numbers(ranges, 2)}"
    return f"{head} {numbers(seat)} {numbers(robot)} {times(t, **more)}"


def robotlaser(t, ranges, robot, laser, *, config="0 -1.57 3.14 0.02 30.0 0.01 0", remissions=()):
    told = " ".join(f"{r:.1f}" for r in remissions)
    head = f"ROBOTLASER1 {config} {len(ranges)} {numbers(ranges, 3)} {len(remissions)} {told}"
    return f"{head} {numbers(laser)} {numbers(robot)} 0.3 -0.1 0.5 0.4 1e6 {times(t)}"


def scan(k, beams=181):
    """Ranges that differ from beam to beam and scan to scan."""
    return np.round(2.0 + 0.01 * np.arange(beams) + 0.03 * k, 2)


@dataclass
class Drive:
    """A robot on a straight line, one ODOM and one FLASER line every tenth of a second."""

    steps: int = 30
    mount: tuple = (0.1, 0.02, 0.0)
    lines: list = field(default_factory=lambda: ["# CARMEN Logfile"])

    def robot(self, k):
        return np.array([0.05 * k, 0.0, 0.1])

    def all(self):
        for k in range(self.steps):
            laser = se2.compose(self.robot(k), np.array(self.mount))
            self.lines.append(odom(0.1 * k, self.robot(k)))
            self.lines.append(flaser(0.1 * k + 0.05, scan(k), self.robot(k), laser))
        return self.lines


def write(path, lines):
    path.write_bytes("\n".join([*lines, ""]).encode())
    return path


def losses_of(log):
    return {(x.kind, x.what.partition(": ")[2], x.reason): x.count for x in log.losses}


def topics_of(log):
    return {topic.topic: topic for topic in log.topics}


@pytest.fixture
def drive(tmp_path):
    return write(tmp_path / "drive.log", Drive().all())


def test_lines_become_rows_with_ipc_stamps_and_logger_times(drive, tmp_path):
    bundle = ingest([drive], tmp_path / "b")
    scans, odometry = bundle.table("scans"), bundle.table("odometry")

    assert {r.role: r.topic for r in bundle.manifest.roles} == {"odometry": "ODOM",
                                                                "scan": "FLASER"}  # fmt: skip
    assert len(scans) == len(odometry) == 30
    assert scans["t_sensor_ns"][3] == 976_052_857_350_000_000
    assert scans["t_log_ns"][3] == 350_000_000
    np.testing.assert_array_equal(scans["ranges_m"][3], scan(3).astype(np.float32))
    np.testing.assert_allclose(odometry["position_xyz"][:, 0], 0.05 * np.arange(30))
    np.testing.assert_allclose(se3.yaw_from_quaternion(odometry["orientation_xyzw"]), 0.1)
    assert odometry["linear_velocity_xyz"][0].tolist() == [0.1, 0.0, 0.0]
    assert odometry["angular_velocity_xyz"][0].tolist() == [0.0, 0.0, 0.2]
    assert np.isnan(odometry["pose_covariance"]).all()
    assert bundle.manifest.clock.name == "sensor"
    assert (bundle.manifest.frames.odom, bundle.manifest.frames.base) == ("odom", "base_link")


def test_the_lasers_place_on_the_robot_comes_from_the_lines(drive, tmp_path):
    lasers = scan_set(ingest([drive], tmp_path / "b").view())

    np.testing.assert_allclose(lasers.xyyaw_base_laser, [0.1, 0.02, 0.0], atol=1e-6)


@pytest.mark.parametrize(
    ("beams", "params", "start", "step"),
    [(180, [], -90.0, 1.0), (181, [], -90.0, 1.0), (360, [], -90.0, 0.5), (361, [], -90.0, 0.5),
     (401, [], -50.0, 0.25), (541, [], -135.0, 0.5), (91, [], -90.0, 2.0),
     (91, ["PARAM laser_front_laser_resolution 1.0 nohost 0"], -45.0, 1.0)],
)  # fmt: skip
def test_bearings_are_carmens(tmp_path, beams, params, start, step):
    log = read_carmen(
        write(tmp_path / "a.clf", [*params, flaser(0, scan(0, beams), [0] * 3)]), None
    )
    columns = topics_of(log)["FLASER"].columns

    assert np.degrees(columns["angle_min_rad"]).tolist() == pytest.approx([start])
    assert np.degrees(columns["angle_increment_rad"]).tolist() == pytest.approx([step])


def test_lasers_that_tell_their_configuration(tmp_path):
    lines = [
        robotlaser(0.0, scan(0, 4), [1, 0, 0], [1.2, 0, 0], remissions=[1, 2, 3, 4]),
        # Before 2006 there was no remission mode.
        robotlaser(0.1, scan(1, 4), [1, 0, 0], [1.2, 0, 0], config="0 -1.57 3.14 0.02 30.0 0.01"),
        f"RAWLASER3 0 -1.0 2.0 0.5 20.0 0.01 0 3 1.0 2.0 3.0 0 {times(0.2)}",
        flaser(0.3, scan(0, 5), [1, 0, 0], [0.7, 0, np.pi], name="RLASER"),
    ]
    log = read_carmen(write(tmp_path / "a.clf", lines), None)
    found = topics_of(log)

    assert found["ROBOTLASER1"].columns["ranges_m"].lengths.tolist() == [4, 4]
    assert found["ROBOTLASER1"].columns["range_max_m"].tolist() == [30.0, 30.0]
    assert found["ROBOTLASER1"].columns["angle_increment_rad"].tolist() == [0.02, 0.02]
    assert found["RAWLASER3"].columns["ranges_m"][0].tolist() == [1.0, 2.0, 3.0]
    assert found["RAWLASER3"].frame() == "laser_3"
    static = found["tf_static"].columns
    assert static["child_frame"].tolist() == ["laser", "rear_laser"]
    np.testing.assert_allclose(static["translation_xyz"][:, 0], [0.2, -0.3])
    np.testing.assert_allclose(np.abs(se3.yaw_from_quaternion(static["rotation_xyzw"])), [0, np.pi],
                               atol=1e-6)  # fmt: skip
    odometry = found["ROBOTLASER1 odometry"].columns
    assert odometry["linear_velocity_xyz"][:, 0].tolist() == [0.3, 0.3]


def test_param_places_a_laser_whose_lines_do_not(tmp_path):
    params = ["PARAM robot_frontlaser_offset 0.25 nohost 0",
              "PARAM robot_rearlaser_offset 0.3 nohost 0"]  # fmt: skip
    raw = "0 -1.0 2.0 0.5 20.0 0.01 0 3 1.0 2.0 3.0 0"
    lines = [*params, f"RAWLASER1 {raw} {times(0)}", f"RAWLASER2 {raw} {times(0)}"]
    static = topics_of(read_carmen(write(tmp_path / "a.clf", lines), None))["tf_static"].columns

    # Without its angle nobody knows which way a rear laser's offset is counted.
    assert static["child_frame"].tolist() == ["laser"]
    assert static["translation_xyz"].tolist() == [[0.25, 0.0, 0.0]]


def test_corrected_laser_poses_are_no_place_on_the_robot(tmp_path):
    lines = [flaser(0.1 * k, scan(k), [0.1 * k, 0, 0], [0.1 * k, 0.03 * k, 0]) for k in range(20)]
    log = read_carmen(write(tmp_path / "a.clf", lines), None)
    reason = "laser poses that keep no one place on the robot: corrected ones"

    assert losses_of(log)["skipped", "FLASER", reason] == 20
    assert "tf_static" not in topics_of(log)


def test_odometry_on_laser_lines_is_left_out_beside_odom_lines_and_used_without(tmp_path, drive):
    beside = read_carmen(drive, None)
    alone = [line for line in Drive().all() if not line.startswith("ODOM")]
    without = read_carmen(write(tmp_path / "alone.clf", alone), None)
    reason = "left out beside the ODOM lines: it may be an older one"

    assert losses_of(beside)["skipped", "odometry on FLASER lines", reason] == 30
    assert [t.topic for t in beside.topics if t.table == "odometry"] == ["ODOM"]
    (odometry,) = [t for t in without.topics if t.table == "odometry"]
    assert (odometry.topic, len(odometry)) == ("FLASER odometry", 30)
    assert np.isnan(odometry.columns["linear_velocity_xyz"]).all()


def test_speeds_that_are_zero_while_the_robot_moves_were_not_recorded(tmp_path):
    lines = [odom(0.1 * k, [0.1 * k, 0, 0], (0, 0)) for k in range(5)]
    (odometry,) = read_carmen(write(tmp_path / "a.clf", lines), None).topics

    assert np.isnan(odometry.columns["linear_velocity_xyz"]).all()


def test_the_simulators_truth_only_judges(tmp_path):
    lines = Drive().all()
    lines += [f"TRUEPOS {0.05 * k:.6f} 1.0 0.1 0 0 0 {times(0.1 * k)}" for k in range(30)]
    bundle = ingest([write(tmp_path / "a.clf", lines)], tmp_path / "b")
    rows = bundle.table("references")

    assert (len(rows), set(rows["kind"]), set(rows["frame_id"])) == (30, {"simulation"}, {"map"})
    assert {r.role: r.topic for r in bundle.manifest.roles}["reference"] == "TRUEPOS"
    assert len(bundle.view().table("references")) == 0


def test_what_cannot_be_read_is_counted(tmp_path):
    good = Drive(steps=5).all()
    bad = [
        "FLASER 180 1.0 2.0", "FLASER x 1.0 0 0 0 0 0 0 1 nohost 1", "ODOM 0 0 0 0 0 nohost 1",
        odom(1, [0, 0, 0]).replace("0.100000", "0.1.0"), odom(1, [0, 0, np.nan]),
        odom(1, [0, 0, 0]).replace("nohost 1.000000", "nohost one"),
        f"SYNC marker {times(1)}", f"NMEAGGA 1 2 3 {times(1)}", "PARAM", "\x00\x01binary", "",
        flaser(1, [1.0, np.nan, 3.0], [0, 0, 0], [0.1, 0.02, 0.0]), flaser(1, [], [0, 0, 0]),
    ]  # fmt: skip
    log = read_carmen(write(tmp_path / "a.clf", [*good, *bad]), None)

    assert losses_of(log) == {
        ("lost", "FLASER", "wrong number of fields"): 2,
        ("lost", "FLASER", "no beams, or no angles"): 1,
        ("lost", "ODOM", "wrong number of fields"): 1,
        ("lost", "ODOM", "a field is no number"): 1,
        ("lost", "ODOM", "a time is no number"): 1,
        ("lost", "ODOM", "pose is not finite"): 1,
        ("lost", "ranges of FLASER", "they are no number"): 1,
        ("lost", "lines", "they begin with no message's name"): 1,
        ("skipped", "SYNC", "no decoder for it"): 1,
        ("skipped", "NMEAGGA", "no decoder for it"): 1,
        ("lost", "PARAM", "wrong number of fields"): 1,
        ("skipped", "odometry on FLASER lines",
         "left out beside the ODOM lines: it may be an older one"): 6,
    }  # fmt: skip
    assert len(topics_of(log)["FLASER"]) == 6


@pytest.mark.parametrize("compress", [gzip.compress, bz2.compress])
def test_a_file_that_was_cut_is_read_up_to_the_cut(tmp_path, compress):
    rng = np.random.Generator(np.random.PCG64(1))
    lines = []
    for k in range(4000):  # bzip2 compresses 900 kB at a time
        lines += [odom(0.1 * k, [0.01 * k, 0, 0])]
        lines += [flaser(0.1 * k, rng.uniform(1, 9, 181), [0.01 * k, 0, 0])]
    raw = compress("\n".join(lines).encode())
    whole, cut = tmp_path / "whole", tmp_path / "cut.clf"
    whole.write_bytes(raw)
    cut.write_bytes(raw[: len(raw) // 2])
    bundle = ingest([cut], tmp_path / "b")

    assert len(ingest([whole], tmp_path / "w").table("scans")) == 4000
    assert 1000 < len(bundle.table("scans")) < 2100
    (loss,) = [x for x in bundle.manifest.losses if x.what == "cut.clf: its end"]
    assert loss.kind == "lost"
    assert "in the middle of its compressed data" in loss.reason


def test_joined_members_are_one_text_and_what_is_no_member_is_counted(tmp_path):
    lines = "\n".join([*Drive(steps=5).all(), ""]).encode()
    path = tmp_path / "a.gz"
    path.write_bytes(gzip.compress(lines) + bz2.compress(lines) + b"\0" * 512)
    assert len(topics_of(read_carmen(path, None))["FLASER"]) == 10

    path.write_bytes(gzip.compress(lines) + b"something else")
    log = read_carmen(path, None)
    assert len(topics_of(log)["FLASER"]) == 5
    assert [x.kind for x in log.losses if x.what == "a.gz: its end"] == ["lost"]


@pytest.mark.parametrize(
    ("content", "error"),
    # No time in the header: it stands in the test's name, which all workers must give alike.
    [(gzip.compress(b"hello " * 99, mtime=0)[:8], "not a log"),
     (b"BZh9", "not a log"), (b"", "empty"),
     (b"some text\nODOM to joy\n", "not a log"), (b"# CARMEN Logfile\n#", "nothing to work")],
)  # fmt: skip
def test_what_is_no_carmen_log_is_refused_in_one_line(tmp_path, content, error):
    path = tmp_path / "a.clf"
    path.write_bytes(content)

    with pytest.raises(LogError, match=error):
        ingest([path], tmp_path / "b")


def test_a_carmen_log_is_told_by_its_content(drive, tmp_path):
    renamed = drive.rename(tmp_path / "whatever.bag")

    assert text_log(renamed) is not None
    assert text_log(tmp_path / "missing") is None
    with pytest.raises(UsageError, match="holds one robot"):
        ingest([renamed], tmp_path / "b", IngestOptions(robot="robot1"))
    with pytest.raises(UsageError, match="read alone"):
        ingest([renamed, renamed], tmp_path / "b")


def test_stamps_that_step_back_are_kept_and_rows_stay_in_the_order_of_the_file(tmp_path):
    lines = []
    for k in range(200):
        late = 0.7 if k % 20 == 10 else 0.0  # the next messages overtake such a stamp
        t = 0.1 * k + late
        robot = [0.05 * k, 0, 0]
        lines += [odom(t, robot), flaser(t + 0.001, scan(k), robot)]
    bundle = ingest([write(tmp_path / "a.clf", lines)], tmp_path / "b")
    scans = bundle.table("scans")

    assert (np.diff(scans["t_sensor_ns"]) < 0).sum() == 10
    np.testing.assert_allclose(scans["ranges_m"].values.reshape(200, -1)[:, 0],
                               2.0 + 0.03 * np.arange(200), atol=1e-3)  # fmt: skip
    way = odometry_track(bundle.view()).xyyaw[:, 0]
    assert np.abs(np.diff(way)).sum() == pytest.approx(way[-1] - way[0])
    repaired = {x.what: x.count for x in bundle.manifest.losses if "stamps" in x.reason}
    assert repaired == {"FLASER": 200, "ODOM": 200}


def test_one_stamp_that_steps_back_leaves_the_others_alone(tmp_path):
    lines = Drive(steps=300).all()
    lines[301] = odom(15.0, [7.5, 0, 0.1], ipc=IPC + 14.2)
    bundle = ingest([write(tmp_path / "a.clf", lines)], tmp_path / "b")
    odometry = bundle.table("odometry")
    moved = np.flatnonzero(odometry.t_ns != odometry["t_sensor_ns"])

    assert moved.tolist() == [150]
    np.testing.assert_allclose(odometry["position_xyz"][:, 0], 0.05 * np.arange(300))


def test_a_log_without_a_map_gets_a_report_that_says_so(drive, tmp_path):
    found = postmortem(ingest([drive], tmp_path / "b"))

    assert found.judgement.state == "insufficient_data"
    clocks = [f.message for f in found.findings if f.id == "SR-CLK-001"]
    assert len(clocks) == 1
    assert "count from when the recorder was started" in clocks[0]


def readings(rng, *, far, count=200, beams=181):
    """Scans of a room whose walls are up to `far` metres away."""
    return rng.uniform(0.5, far, (count, beams)).round(2)


def ragged(values):
    return Ragged.of(values, np.float64)


@pytest.mark.parametrize("code", [81.83, 50.0, 8.19, 29.99])
def test_the_code_of_beams_without_a_return_is_found(code):
    rng = np.random.Generator(np.random.PCG64(2))
    values = readings(rng, far=min(0.97 * code, 30.0))
    values[rng.uniform(size=values.shape) < 0.1] = code
    values[0, :3] = [81.9, 81.91, 0.0]  # other faults

    assert no_return_code(ragged(values), 80.0) == pytest.approx(code)


def test_a_far_wall_is_no_code():
    """A standing robot: the far end of the room is told over and over, by a few beams."""
    rng = np.random.Generator(np.random.PCG64(2))
    values = readings(rng, far=5.0)
    values[:, 90:95] = 12.5

    assert no_return_code(ragged(values), 80.0) is None
    assert no_return_code(ragged(readings(rng, far=30.0)), 80.0) is None


def test_no_return_is_free_space_and_no_wall(tmp_path):
    rng = np.random.Generator(np.random.PCG64(3))
    values = readings(rng, far=9.0, count=40)
    nothing = rng.uniform(size=values.shape) < 0.1
    values[nothing] = 81.83
    values[5, 7] = 81.91
    nothing[5, 7] = False
    lines = [flaser(0.1 * k, v, [0, 0, 0]) for k, v in enumerate(values)]
    lasers = scan_set(ingest([write(tmp_path / "a.clf", lines)], tmp_path / "b").view())

    np.testing.assert_array_equal(lasers.misses, nothing)
    assert lasers.ranges_m[lasers.hits].max() < 9.1
    assert not lasers.hits[5, 7]


def test_hindsight_lays_a_carmen_log_onto_its_map(tmp_path):
    """Bearings, the laser's place and beams without a return have to be right for that."""
    rng = np.random.Generator(np.random.PCG64(4))
    mount, t = np.array([0.2, -0.1, 0.1]), np.arange(0.0, 20.0, 0.1)
    truth = true_path(t)
    steps = se2.between(truth[:-1], truth[1:]) * [1.02, 1.0, 0.98]
    wheels = [np.zeros(3)]
    for step in steps:
        wheels.append(se2.compose(wheels[-1], step))
    bearings = np.radians(np.arange(180) - 90.0)
    ranges = cast_rays(room_grid(), se2.compose(truth, mount), bearings, 8.0)
    ranges = np.where(ranges < 8.0, ranges + rng.normal(0.0, 0.01, ranges.shape), 81.83)
    lines = []
    for k, pose in enumerate(wheels):
        lines += [odom(t[k], pose), flaser(t[k], ranges[k], pose, se2.compose(pose, mount))]
    for name, content in map_files(room_grid(), "map").items():
        (tmp_path / name).write_bytes(content)
    options = IngestOptions(map=tmp_path / "map.yaml")
    found = hindsight(ingest([write(tmp_path / "a.clf", lines)], tmp_path / "b", options).view())

    missed = se2.between(found.track.xyyaw, truth)
    assert np.percentile(np.hypot(missed[:, 0], missed[:, 1]), 95) < 0.06
    assert np.percentile(np.abs(missed[:, 2]), 95) < np.radians(0.6)


NUMBER = st.floats(-1e4, 1e4).map(lambda v: round(v, 6))
RANGES = st.lists(st.floats(0.0, 70.0).map(lambda v: round(v, 2)), min_size=1, max_size=9)
POSE = st.tuples(NUMBER, NUMBER, st.floats(-3.1, 3.1).map(lambda v: round(v, 6)))


@given(st.lists(st.tuples(RANGES, POSE, st.integers(0, 10**15)), min_size=1, max_size=6))
def test_generated_lines_come_back(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("carmen") / "a.clf"
    lines = []
    for k, (ranges, pose, micros) in enumerate(rows):
        ipc = f"{micros // 10**6}.{micros % 10**6:06d} host {k}.5"
        lines.append(f"FLASER {len(ranges)} {' '.join(map(str, ranges))} "
                     f"{numbers(pose)} {numbers(pose)} {ipc}")  # fmt: skip
        lines.append(f"ODOM {numbers(pose)} 1.0 0.5 0.0 {ipc}")
    log = read_carmen(write(path, lines), None)
    found = topics_of(log)

    for topic in ("FLASER", "ODOM"):
        stamps = found[topic].t_sensor_ns
        assert stamps.tolist() == [micros * 1000 for _, _, micros in rows] or not any(
            micros for _, _, micros in rows
        )
    got = found["FLASER"].columns["ranges_m"]
    for k, (ranges, _, _) in enumerate(rows):
        np.testing.assert_array_equal(got[k], np.array(ranges, dtype=np.float32))
    poses = np.array([pose for _, pose, _ in rows])
    np.testing.assert_array_equal(found["ODOM"].columns["position_xyz"][:, :2], poses[:, :2])
    yaw = se3.yaw_from_quaternion(found["ODOM"].columns["orientation_xyzw"])
    np.testing.assert_allclose(yaw, poses[:, 2], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "scans", "odometry", "way_m", "code"),
    [("intel", 13631, 26915, 509.1, 81.83), ("aces", 7374, 7375, 325.2, 50.0)],
)
def test_real_logs(real_logs, tmp_path, name, scans, odometry, way_m, code):
    path = real_logs / "radish" / f"{name}.clf.bz2"
    if not path.is_file():
        pytest.skip(f"no {path}")
    bundle = ingest([path], tmp_path / "b")
    track = odometry_track(bundle.view())
    relations = np.loadtxt(path.with_name(f"{name}.relations"), usecols=(0, 1), dtype=str)
    asked = {int(text.replace(".", "") + "000") for text in relations.ravel()}
    stamps = bundle.table("scans")["t_sensor_ns"]

    assert (len(stamps), len(bundle.table("odometry"))) == (scans, odometry)
    assert asked <= set(stamps.tolist())
    way = np.hypot(*np.diff(track.xyyaw[:, :2], axis=0).T).sum()
    assert way == pytest.approx(way_m, abs=0.1)
    assert set(bundle.table("scans")["range_max_m"]) == {code}
    hits = scan_set(bundle.view())
    assert hits.ranges_m[hits.hits].max() < code - 0.05
