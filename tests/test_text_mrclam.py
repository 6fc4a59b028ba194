"""MRCLAM folders: one robot's speeds, sightings and motion capture, and what is wrong in them."""

import gzip

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from slamreplay.bundle.sightings import sightings_of
from slamreplay.bundle.track import PoseTrack
from slamreplay.errors import LogError, UsageError
from slamreplay.geometry import se2, se3
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest
from slamreplay.ingest.text_logs.mrclam import integrated, read_mrclam
from slamreplay.postmortem import postmortem

START = 1_248_444_187
HEAD = "# UTIAS Multi-Robot Cooperative Localization and Mapping Dataset\n# Time [s] ...\n"
LANDMARKS = {6: (3.0, 1.0), 7: (1.0, -2.0), 8: (-1.0, 2.5)}
BARCODE = {1: 5, 2: 14, 6: 63, 7: 81, 8: 7}


def at(k):
    return f"{START + k // 10}.{k % 10}00"


def write(path, lines):
    path.write_text(HEAD + "".join(f"{line}\n" for line in lines))


@pytest.fixture
def folder(tmp_path):
    """Two robots on circles; robot 2 sees three landmarks and robot 1."""
    folder = tmp_path / "data"
    folder.mkdir()
    t = 0.1 * np.arange(100)
    for robot in (1, 2):
        v, w = 0.2 * robot, 0.1
        truth = np.column_stack([v / w * np.sin(w * t), v / w * (1 - np.cos(w * t)), w * t])
        write(folder / f"Robot{robot}_Odometry.dat", [f"{at(k)} \t {v} \t {w}" for k in range(100)])
        poses = [f"{at(k)} {x:.8f} {y:.8f} {yaw:.8f}" for k, (x, y, yaw) in enumerate(truth)]
        write(folder / f"Robot{robot}_Groundtruth.dat", poses)
        seen = []
        for k in range(0, 100, 5):
            seen += [f"{at(k)} {BARCODE[3 - robot]} 1.5 0.1"]
            for subject, place in LANDMARKS.items():
                x, y, _ = se2.between(truth[k], np.array([*place, 0.0]))
                reach, bearing = np.hypot(x, y), np.arctan2(y, x)
                seen += [f"{at(k)} \t {BARCODE[subject]} {reach:.6f} {bearing:.6f}"]
        write(folder / f"Robot{robot}_Measurement.dat", seen)
    survey = [f"{n} {x} {y} 0.0001 0.0001" for n, (x, y) in LANDMARKS.items()]
    write(folder / "Landmark_Groundtruth.dat", survey)
    write(folder / "Barcodes.dat", [f"{subject} {code}" for subject, code in BARCODE.items()])
    return folder


def losses_of(log):
    return {(x.kind, x.what, x.reason): x.count for x in log.losses}


@pytest.mark.parametrize("robot", ["2", "robot2", "Robot2", "/robot2", "robot_2"])
def test_one_robot_is_read(folder, tmp_path, robot):
    bundle = ingest([folder], tmp_path / "b", IngestOptions(robot=robot))
    odometry = bundle.table("odometry")

    roles = {r.role: r.topic for r in bundle.manifest.roles}
    assert roles == {"odometry": "Robot2_Odometry", "reference": "Robot2_Groundtruth"}
    assert odometry.t_ns[3] == START * 10**9 + 300_000_000
    assert odometry["linear_velocity_xyz"][0].tolist() == [0.4, 0.0, 0.0]
    assert odometry["angular_velocity_xyz"][0].tolist() == [0.0, 0.0, 0.1]
    assert np.isnan(odometry["pose_covariance"]).all()
    assert np.isnan(odometry["twist_covariance"]).all()
    assert (bundle.manifest.frames.map, bundle.manifest.frames.odom) == ("map", "odom")
    reason = "speeds, integrated to poses along arcs of constant speed"
    assert losses_of(bundle.manifest)["repaired", "Robot2_Odometry.dat", reason] == 100


def test_constant_speeds_are_integrated_to_the_circle_they_drive(folder, tmp_path):
    bundle = ingest([folder], tmp_path / "b", IngestOptions(robot="2"))
    truth, odometry = bundle.table("references"), bundle.table("odometry")
    truth = truth.take(truth["kind"] == "motion_capture")

    np.testing.assert_allclose(odometry["position_xyz"], truth["position_xyz"], atol=1e-7)
    np.testing.assert_allclose(odometry["orientation_xyzw"], truth["orientation_xyzw"], atol=1e-7)


SPEED = st.tuples(st.floats(-1.0, 1.0), st.floats(-2.0, 2.0))


@given(st.lists(st.tuples(st.integers(0, 2 * 10**9), SPEED), min_size=1, max_size=5))
def test_arcs_are_those_of_the_differential_equation(steps):
    t_ns = np.cumsum([dt for dt, _ in steps]).astype(np.int64)
    velocity = np.array([speed for _, speed in steps])
    found = integrated(t_ns, velocity)

    pose = np.zeros(3)
    for k in range(len(steps) - 1):
        v, w = velocity[k]
        dt = (t_ns[k + 1] - t_ns[k]) / 1e9
        if dt > 0.0:
            pose = solve_ivp(
                lambda _t, p, v=v, w=w: [v * np.cos(p[2]), v * np.sin(p[2]), w],
                (0.0, dt), pose, rtol=1e-10, atol=1e-12,
            ).y[:, -1]  # fmt: skip
        difference = found[k + 1] - pose
        difference[2] = se2.wrap_angle(difference[2])
        np.testing.assert_allclose(difference, 0.0, atol=1e-8)


def test_landmarks_are_sensed_where_they_are_and_not_how_they_are_turned(folder, tmp_path):
    bundle = ingest([folder], tmp_path / "b", IngestOptions(robot="2"))
    table, view = bundle.table("references"), bundle.view()
    truth = table.take(table["kind"] == "motion_capture")
    yaw = se3.yaw_from_quaternion(truth["orientation_xyzw"])
    xyyaw = np.column_stack([truth["position_xyz"][:, :2], yaw])
    way = PoseTrack.without_covariance("map", "base_link", truth.t_ns, xyyaw)
    rows = view.table("references")
    seen = sightings_of(view, way)

    assert set(rows["kind"]) == {"fiducial"}
    assert set(rows["frame_id"]) == {"base_link"}
    assert np.isnan(rows["orientation_xyzw"]).all()
    assert np.isnan(rows["covariance"]).all()
    assert len(seen) == 60
    placed = se2.compose(way.at(seen.t_ns).xyyaw, seen.xyyaw)
    for number, place in LANDMARKS.items():
        name = f"fiducial landmark_{number}"
        np.testing.assert_allclose(seen.surveyed[name], [*place, np.nan])
        np.testing.assert_allclose(placed[seen.name == name, :2], [place] * 20, atol=1e-4)
    assert np.isnan(seen.xyyaw[:, 2]).all()
    reason = "barcodes of other robots"
    assert losses_of(bundle.manifest)["skipped", "Robot2_Measurement.dat", reason] == 20


def test_several_robots_need_a_choice(folder, tmp_path):
    with pytest.raises(UsageError, match=r"2 robots: Robot1, Robot2 \(hint: .*--robot 1\)"):
        ingest([folder], tmp_path / "b")
    for robot in ("3", "robot", "two", "²"):
        with pytest.raises(UsageError, match="there are: Robot1, Robot2"):
            ingest([folder], tmp_path / "b", IngestOptions(robot=robot))
    (folder / "Robot1_Odometry.dat").unlink()
    assert len(ingest([folder], tmp_path / "b").table("odometry")) == 100


def test_one_file_of_the_folder_is_no_log(folder, tmp_path):
    with pytest.raises(LogError, match=r"hint: give the folder"):
        ingest([folder / "Robot1_Odometry.dat"], tmp_path / "b")


def test_what_is_wrong_or_missing_is_counted(folder):
    def add(name, *lines):
        with (folder / name).open("a") as file:
            file.write("\n".join(["", *lines, ""]))

    add("Robot1_Odometry.dat", "1 2", f"{at(100)} x 0.1", f"{at(100)} nan 0.1", f"{at(120)} 0 0",
        "later 0 0", "1e30 0 0")  # fmt: skip
    add("Robot1_Measurement.dat", f"{at(3)} 99 1.0 0.0", f"{at(3)} 63 0.0 0.0", "1 2 3 4 5")
    (folder / "Robot1_Groundtruth.dat").unlink()
    log = read_mrclam(folder, "1")

    odometry, measurement = "Robot1_Odometry.dat", "Robot1_Measurement.dat"
    assert losses_of(log) == {
        ("lost", odometry, "wrong number of columns"): 1,
        ("lost", odometry, "a field is no finite number"): 3,
        ("lost", odometry, "a time is no number"): 1,
        ("repaired", odometry, "gaps of more than a second: the last speed is held"): 1,
        ("repaired", odometry, "speeds, integrated to poses along arcs of constant speed"): 101,
        ("lost", measurement, "wrong number of columns"): 1,
        ("lost", measurement, "barcodes that nobody has"): 1,
        ("lost", measurement, "range is not positive"): 1,
        ("skipped", measurement, "barcodes of other robots"): 20,
        ("skipped", "Landmark_Groundtruth.dat", "standard deviations: transforms carry none"): 3,
        ("lost", "Robot1_Groundtruth.dat", "the file is missing"): 1,
    }
    for name in ("Barcodes.dat", "Landmark_Groundtruth.dat", "Robot1_Measurement.dat"):
        (folder / name).unlink()
    assert [t.topic for t in read_mrclam(folder, "1").topics] == ["Robot1_Odometry"]
    write(folder / "Robot1_Odometry.dat", [])
    with pytest.raises(LogError, match="no odometry in it"):
        read_mrclam(folder, "1")


def test_files_may_be_compressed_and_cut(folder):
    path = folder / "Robot1_Odometry.dat"
    lines = [f"{at(k)} {0.001 * (k * 7919 % 997):.3f} {0.1}" for k in range(5000)]
    raw = gzip.compress((HEAD + "\n".join(lines)).encode())
    path.write_bytes(raw[: len(raw) // 2])
    log = read_mrclam(folder, "1")

    assert 1500 < len(log.topics[0]) < 3500
    assert [x.kind for x in log.losses if x.what.endswith("its end")] == ["lost"]


def test_a_report_says_that_there_is_nothing_to_judge(folder, tmp_path):
    found = postmortem(ingest([folder], tmp_path / "b", IngestOptions(robot="1")))

    assert found.judgement.state == "insufficient_data"
    assert found.reference_kind == "motion_capture"


def test_real_folder(real_logs, tmp_path):
    folder = real_logs / "mrclam6"
    if not folder.is_dir():
        pytest.skip(f"no {folder}")
    bundle = ingest([folder], tmp_path / "b", IngestOptions(robot="3"))
    table = bundle.table("references")
    truth = table.take(table["kind"] == "motion_capture")
    yaw = se3.yaw_from_quaternion(truth["orientation_xyzw"])
    xyyaw = np.column_stack([truth["position_xyz"][:, :2], yaw])
    way = PoseTrack.without_covariance("map", "base_link", truth.t_ns, xyyaw)
    seen = sightings_of(bundle.view(), way)
    placed = se2.compose(way.at(seen.t_ns).xyyaw, seen.xyyaw)[:, :2]
    surveyed = np.array([seen.surveyed[name][:2] for name in seen.name])

    assert (len(bundle.table("odometry")), len(truth), len(seen)) == (61158, 56977, 4348)
    assert len(seen.surveyed) == 15
    # Landmarks stand where they were surveyed: frames and signs are right.
    assert np.nanmedian(np.hypot(*(placed - surveyed).T)) < 0.1
