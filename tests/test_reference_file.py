"""References from files: poses and covariances as written, and every mistake in one line."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from slamreplay.errors import LogError
from slamreplay.geometry.covariance import ros_from_openvins
from slamreplay.ingest.reference_file import read_reference

HEADER = (
    "# timestamp(s) tx ty tz qx qy qz qw "
    "Pr11 Pr12 Pr13 Pr22 Pr23 Pr33 Pt11 Pt12 Pt13 Pt22 Pt23 Pt33"
)
UPPER = np.triu_indices(3)


@pytest.fixture
def read(tmp_path):
    def reading(text):
        path = tmp_path / "gt.txt"
        path.write_text(text, encoding="utf-8")
        return read_reference(path, "map", "base_link")

    return reading


def line(t, position, quaternion, rotation=None, place=None):
    values = [*position, *quaternion]
    if rotation is not None:
        values += [*rotation[UPPER], *place[UPPER]]
    return f"{t} " + " ".join(f"{v:.17g}" for v in values)


def test_openvins_covariance_is_turned_to_the_parents_axes(read):
    """A robot that faces along y: what its own x axis is uncertain by, the map's y axis is."""
    quarter = [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
    text = line("1.5", [1, 2, 3], quarter, np.diag([0.01, 0.02, 0.03]), np.diag([4.0, 5.0, 6.0]))
    topic, losses = read(f"{HEADER}\n{text}\n")
    cov = topic.columns["covariance"][0].reshape(6, 6)

    np.testing.assert_allclose(cov, np.diag([4.0, 5.0, 6.0, 0.02, 0.01, 0.03]), atol=1e-12)
    assert losses == []


def test_the_error_of_openvins_is_local():
    """Oracle: samples of its error, R_body_parent = exp(-theta) R_body_parent_hat, seen from the
    parent as ROS defines it, R = exp(phi) R_hat."""
    rng = np.random.Generator(np.random.PCG64(5))
    rotation = np.diag([1e-3, 2e-3, 4e-3]) ** 2 + 1e-7
    R_hat = Rotation.from_euler("zyx", [2.0, -0.4, 0.9])
    theta = rng.multivariate_normal(np.zeros(3), rotation, 200_000)
    true = (Rotation.from_rotvec(-theta) * R_hat.inv()).inv()
    phi = (true * R_hat.inv()).as_rotvec()

    found = ros_from_openvins(rotation, np.eye(3), R_hat.as_matrix())
    np.testing.assert_allclose(found[3:, 3:], np.cov(phi.T), atol=1e-7)
    np.testing.assert_array_equal(found[:3, :3], np.eye(3))
    np.testing.assert_array_equal(found[:3, 3:], 0.0)


FLOAT = st.floats(-1e3, 1e3)
FACTOR = st.lists(st.floats(-1.0, 1.0), min_size=9, max_size=9)
POSE = st.tuples(st.integers(0, 4 * 10**18), st.tuples(FLOAT, FLOAT, FLOAT),
                 st.tuples(*[st.floats(0.1, 1.0)] * 4), FACTOR, FACTOR)  # fmt: skip


@given(st.lists(POSE, min_size=1, max_size=4))
def test_generated_files_come_back(tmp_path_factory, poses):
    rows, expected = [], []
    for t_ns, position, quaternion, first, second in poses:
        unit = np.array(quaternion) / np.linalg.norm(quaternion)
        rotation, place = (
            (A := np.array(f).reshape(3, 3)) @ A.T + 1e-3 * np.eye(3) for f in (first, second)
        )
        rows.append(line(f"{t_ns // 10**9}.{t_ns % 10**9:09d}", position, unit, rotation, place))
        R = Rotation.from_quat(unit).as_matrix()
        full = np.zeros((6, 6))
        full[:3, :3], full[3:, 3:] = place, R @ rotation @ R.T
        expected.append((t_ns, position, full))
    path = tmp_path_factory.mktemp("tum") / "est.txt"
    path.write_text("\n".join([HEADER, *rows]))
    topic, losses = read_reference(path, "map", "base_link")

    assert losses == []
    assert topic.t_sensor_ns.tolist() == [t for t, _, _ in expected]
    for row, (_, position, full) in enumerate(expected):
        np.testing.assert_array_equal(topic.columns["position_xyz"][row], position)
        cov = topic.columns["covariance"][row].reshape(6, 6)
        np.testing.assert_allclose(cov, full, atol=1e-12)


def test_lines_with_and_without_covariance_may_be_mixed(read):
    eye = np.eye(3)
    rows = [line("1", [0] * 3, [0, 0, 0, 1]), line("2", [0] * 3, [0, 0, 0, 1], eye, eye)]
    topic, _ = read("\n".join(rows))

    assert np.isnan(topic.columns["covariance"][0]).all()
    np.testing.assert_array_equal(topic.columns["covariance"][1].reshape(6, 6), np.eye(6))


def test_covariances_that_are_none_are_counted(read):
    eye, zero, negative = np.eye(3), np.zeros((3, 3)), np.diag([1.0, -1.0, 1.0])
    pairs = [(eye, eye), (zero, zero), (negative, eye), (eye, negative)]
    rows = [line(k, [0] * 3, [0, 0, 0, 1], *pair) for k, pair in enumerate(pairs)]
    topic, losses = read("\n".join(rows))

    assert np.isfinite(topic.columns["covariance"]).all(axis=1).tolist() == [True, False, False,
                                                                             False]  # fmt: skip
    assert [(x.kind, x.count) for x in losses] == [("lost", 3)]


def test_csv_may_hold_planar_covariances_or_those_of_openvins(read):
    topic, _ = read("t,x,y,yaw,note,cov_xx,cov_xy,cov_yy,cov_yawyaw\n1,2,3,0.5,ok,4,1,5,0.01\n")
    cov = topic.columns["covariance"][0].reshape(6, 6)
    assert cov[0, :2].tolist() == [4.0, 1.0]
    assert (cov[1, 1], cov[5, 5], cov[0, 5]) == (5.0, 0.01, 0.0)

    names = HEADER.removeprefix("# ").replace(" ", ",")
    values = line("1", [0] * 3, [0, 0, 0, 1], np.eye(3), 2.0 * np.eye(3)).replace(" ", ",")
    topic, _ = read(f"{names}\n{values}\n")
    assert np.diag(topic.columns["covariance"][0].reshape(6, 6)).tolist() == [2.0] * 3 + [1.0] * 3


GOOD = "1 0 0 0 0 0 0 1\n"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (GOOD + "2 0 0 0 0 0 0\n", r"gt.txt, line 2: 7 columns are no pose \(hint: expected: t x"),
        ("# a\n\n" + GOOD + "2" + " 0" * 18, r"gt.txt, line 4: 19 columns are no pose \(hint: "),
        (GOOD + "2 0 a 0 0 0 0 1\n", r"gt.txt, line 2: 'a' is no number \(hint: column 3 is y\)"),
        (GOOD + "2 0 1_0 0 0 0 0 1\n", r"line 2: '1_0' is no number"),
        (GOOD + "2 0 ² 0 0 0 0 1\n", r"line 2: '²' is no number"),
        (GOOD + "nan 0 0 0 0 0 0 1\n", r"line 2: 'nan' is no time in seconds \(hint: "),
        (GOOD + "x 0 0 0 0 0 0 1\n", r"line 2: 'x' is no time in seconds"),
        ("1403636579763555584 0 0 0 0 0 0 1\n", r"line 1: '1403636579763555584' is no time in s"),
        ("1e12 0 0 0 0 0 0 1\n", r"hint: a column of nanoseconds is called t_ns, in a header line"),
        ("t_ns,x,y,yaw\n1.5,0,0,0\n", r"line 2: '1.5' is no time in whole nanoseconds \(hint: "),
        ("t_ns,x,y,yaw\n1e30,0,0,0\n", r"line 2: '1e30' is no time in whole nanoseconds"),
        ("t,x,yaw\n1,2,3\n", r"gt.txt, line 1: the reference lacks y \(hint: the header names: t"),
        ("a,b\n1,2\n", r"line 1: the reference lacks x, y, t, yaw or qx qy qz qw"),
        ("t,x,y,yaw,cov_xx\n1,2,3,0,1\n", r"the reference lacks cov_yy, cov_yawyaw"),
        ("t,x,y,yaw,Pr11\n1,2,3,0,1\n", r"the reference lacks pr12, pr13"),
        ("t,x,tx,y,yaw\n1,2,3,0,1\n", r"two columns are x"),
        ("t,x,y,yaw\n1,2,3\n", r"line 2: 3 columns are no pose \(hint: the header names 4: t x"),
        ("t,x,y,yaw\n", r"gt.txt: the reference holds no poses \(hint: "),
        ("", r"gt.txt: the reference holds no poses \(hint: "),
    ],
)  # fmt: skip
def test_each_mistake_is_one_line_with_file_place_and_hint(read, text, says):
    with pytest.raises(LogError, match=says) as error:
        read(text)

    assert "\n" not in str(error.value)


def test_a_file_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / "gt.txt"
    path.write_bytes(b"\x93\x00\xff")

    for where in (path, tmp_path / "gone.txt"):
        with pytest.raises(LogError, match=r"cannot read the reference.*hint: TUM or CSV"):
            read_reference(where, "map", "base_link")


def test_poses_that_are_none_are_counted(read):
    rows = [GOOD, "2 nan 0 0 0 0 0 1\n", "3 0 0 0 0 0 0 0\n", "4 0 0 0 0 0 0 2\n"]
    topic, losses = read("".join(rows))

    assert topic.t_sensor_ns.tolist() == [10**9, 4 * 10**9]
    assert {(x.kind, x.reason, x.count) for x in losses} == {
        ("lost", "position is not finite", 1),
        ("lost", "quaternion is zero or not finite", 1),
        ("repaired", "quaternion normalised", 1),
    }
