"""Frames and covariances, never tested at 0 or 90 degrees only: a lost transpose passes there."""

import gtsam
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from slamreplay.errors import TransformError
from slamreplay.geometry import covariance, se2, se3
from slamreplay.geometry.times import decimal_seconds, stamp_ns
from slamreplay.geometry.transforms import Edge, TransformBuffer

coordinate = st.floats(-50, 50)
angle = st.floats(-3.1, 3.1)
pose = st.tuples(coordinate, coordinate, angle).map(np.array)


@given(pose, pose)
def test_between_undoes_compose(a, b):
    np.testing.assert_allclose(se2.between(a, se2.compose(a, b)), b, atol=1e-9)


@given(pose, pose)
def test_compose_agrees_with_gtsam(a, b):
    expected = gtsam.Pose2(*a).compose(gtsam.Pose2(*b))

    got = se2.compose(a, b)

    np.testing.assert_allclose(got[:2], [expected.x(), expected.y()], atol=1e-9)
    assert abs(se2.wrap_angle(got[2] - expected.theta())) < 1e-9


def test_quaternion_beyond_float64_becomes_nan():
    unit, sound = se3.unit_quaternion([[1e200, 0, 0, 1e200], [np.inf, 0, 0, 0]])
    assert np.isnan(unit).all()
    assert not sound.any()


@given(pose)
def test_planar_undoes_from_planar(a):
    np.testing.assert_allclose(se3.planar(se3.from_planar(a)), a, atol=1e-9)


@given(pose)
def test_points_move_as_matrices_move_them(a):
    points = np.array([[1.0, 2.0], [-3.0, 0.5]])

    expected = (se3.from_planar(a) @ np.column_stack([points, [0, 0], [1, 1]]).T).T[:, :2]

    np.testing.assert_allclose(se2.transform_points(a, points), expected, atol=1e-9)


def test_wrap_angle_takes_the_half_open_interval():
    np.testing.assert_allclose(se2.wrap_angle([np.pi, -np.pi, 3 * np.pi]), [-np.pi] * 3)


def test_interpolation_takes_the_short_way_round():
    t = np.array([0, 10], dtype=np.int64)
    poses = np.array([[0.0, 0.0, 3.0], [2.0, 4.0, -3.0]])

    middle = se2.interpolate(t, poses, np.array([5], dtype=np.int64))[0]

    np.testing.assert_allclose(middle[:2], [1.0, 2.0])
    assert abs(se2.wrap_angle(middle[2] - np.pi)) < 1e-9


def test_rotation_matrix_agrees_with_scipy():
    q = np.random.default_rng(1).normal(size=(20, 4))

    np.testing.assert_allclose(
        se3.rotation_matrix(q), Rotation.from_quat(q).as_matrix(), atol=1e-12
    )


def test_yaw_agrees_with_scipy_for_tilted_robots():
    rotation = Rotation.from_euler("ZYX", [[0.7, 0.2, -0.1], [-2.0, 0.05, 0.3]])

    np.testing.assert_allclose(se3.yaw_from_quaternion(rotation.as_quat()), [0.7, -2.0])


def test_quaternion_without_rotation_becomes_nan():
    unit, sound = se3.unit_quaternion([[0, 0, 0, 0], [0, 0, 0, 2.0], [0, 0, 0, 1.0]])

    assert np.isnan(unit[0]).all()
    assert sound.tolist() == [False, False, True]
    np.testing.assert_array_equal(unit[1], [0, 0, 0, 1])


def test_ros_covariance_becomes_gtsams_by_monte_carlo():
    """Samples of ROS's error (parent axes) mapped through gtsam's own local coordinates."""
    rng = np.random.default_rng(7)
    root = np.tril(rng.normal(size=(6, 6))) * 1e-3
    ros = root @ root.T
    mean = gtsam.Pose3(gtsam.Rot3.RzRyRx(0.3, -0.5, 1.1), np.array([10.0, -4.0, 2.0]))
    errors = rng.normal(size=(40_000, 6)) @ root.T
    R = mean.rotation().matrix()
    local = []
    for error in errors:
        turn = gtsam.Rot3.Expmap(error[3:]).matrix() @ R
        moved = gtsam.Pose3(gtsam.Rot3(turn), mean.translation() + error[:3])
        local.append(mean.localCoordinates(moved))

    got = covariance.gtsam_from_ros(ros, R)

    np.testing.assert_allclose(np.cov(np.array(local).T), got, atol=4e-2 * np.abs(got).max())
    np.testing.assert_allclose(covariance.ros_from_gtsam(got, R), ros, atol=1e-18)


def test_planar_covariance_becomes_gtsams_by_monte_carlo():
    rng = np.random.default_rng(8)
    root = np.tril(rng.normal(size=(3, 3))) * 1e-3
    planar = root @ root.T
    mean = gtsam.Pose2(3.0, -2.0, 0.7)
    local = [
        mean.localCoordinates(gtsam.Pose2(3.0 + e[0], -2.0 + e[1], 0.7 + e[2]))
        for e in rng.normal(size=(40_000, 3)) @ root.T
    ]

    got = covariance.gtsam_from_planar(planar, 0.7)

    np.testing.assert_allclose(np.cov(np.array(local).T), got, atol=4e-2 * np.abs(got).max())
    np.testing.assert_allclose(covariance.planar_from_gtsam(got, 0.7), planar, atol=1e-18)


def test_composed_and_parted_poses_have_the_covariance_of_their_samples():
    """By Monte Carlo at generic poses; errors are about the parent's axes, as ROS has them."""
    rng = np.random.default_rng(9)
    roots = [np.tril(rng.normal(size=(3, 3))) * 1e-3 for _ in range(2)]
    one, two = np.array([3.0, -2.0, 0.7]), np.array([1.3, 2.1, -1.9])
    cov = [root @ root.T for root in roots]
    a, b = (x + rng.normal(size=(60_000, 3)) @ r.T for x, r in zip((one, two), roots, strict=True))

    for got, samples in [
        (covariance.composed(one, cov[0], two, cov[1]), se2.compose(a, b)),
        (covariance.between(one, cov[0], two, cov[1]), se2.between(a, b)),
    ]:
        np.testing.assert_allclose(np.cov(samples.T), got, atol=2e-2 * np.abs(got).max())


def test_parting_is_what_composing_was():
    rng = np.random.default_rng(10)
    root = rng.normal(size=(4, 3, 3))
    step, cov = rng.normal(size=(4, 3)), root @ np.swapaxes(root, 1, 2)
    start, nothing = rng.normal(size=(4, 3)), np.zeros((4, 3, 3))
    end = se2.compose(start, step)

    got = covariance.between(start, nothing, end, covariance.composed(start, nothing, step, cov))

    np.testing.assert_allclose(got, cov, atol=1e-12)


def test_turned_ros_covariances_are_those_of_turned_errors():
    """By samples through a generic rotation; what is not told spoils only what it takes part in."""
    rng = np.random.default_rng(11)
    root = np.tril(rng.normal(size=(6, 6)))
    ros = root @ root.T
    R = se3.rotation_matrix(np.array([0.2, -0.4, 0.5, 0.7]))
    errors = rng.normal(size=(50_000, 6)) @ root.T
    moved = np.column_stack([errors[:, :3] @ R.T, errors[:, 3:] @ R.T])

    got = covariance.ros_turned(ros.reshape(36), R)

    np.testing.assert_allclose(np.cov(moved.T), got, atol=2e-2 * np.abs(got).max())
    level = se3.from_planar(np.array([0.0, 0.0, 0.7]))[:3, :3]
    ros[2] = ros[:, 2] = np.nan
    planar = covariance.planar_from_ros(ros)
    np.testing.assert_allclose(
        covariance.planar_from_ros(covariance.ros_turned(ros, level)),
        covariance.turned(planar, 0.7),
    )
    assert np.isnan(covariance.ros_turned(ros, R)).any(axis=0)[:3].all()


def test_planar_block_is_x_y_and_yaw():
    full = np.arange(36.0)

    assert covariance.planar_from_ros(full).tolist() == [[0, 1, 5], [6, 7, 11], [30, 31, 35]]
    back = covariance.planar_from_ros(covariance.ros_from_planar(np.arange(9.0).reshape(3, 3)))
    assert back.ravel().tolist() == list(range(9))


def test_matrices_that_are_no_covariance():
    good = np.diag([1e-12, 1.0, 2.0])
    asymmetric = good.copy()
    asymmetric[0, 1] = 0.1
    indefinite = np.array([[1.0, 2.0, 0], [2.0, 1.0, 0], [0, 0, 1.0]])
    batch = np.stack([good, np.zeros((3, 3)), asymmetric, indefinite, good * np.nan])

    assert covariance.is_positive_definite(batch).tolist() == [True, False, False, False, False]


def test_stamps_do_not_wrap_at_32_bits():
    assert stamp_ns(np.int32(1_700_000_000), np.uint32(999_999_999)) == 1_700_000_000_999_999_999


@pytest.mark.parametrize(
    ("t_ns", "text"),
    [(0, "0.000000000"), (1_700_000_000_000_000_001, "1700000000.000000001"), (-1, "-0.000000001")],
)
def test_decimal_seconds_keep_the_last_nanosecond(t_ns, text):
    assert decimal_seconds(t_ns) == text


def edge(parent, child, poses, t_ns=(0,), *, is_static=False):
    poses = np.atleast_2d(np.asarray(poses, dtype=float))
    xyz = np.column_stack([poses[:, :2], np.zeros(len(poses))])
    quaternion = se3.quaternion_from_yaw(poses[:, 2])
    return Edge(parent, child, np.array(t_ns, dtype=np.int64), xyz, quaternion, is_static)


def test_lookup_walks_both_parent_orders():
    above = TransformBuffer(
        [edge("map", "odom", [1, 2, 0.3], is_static=True), edge("odom", "base", [4, 5, 0.6])]
    )
    below = TransformBuffer(
        [
            edge("odom", "map", se2.inverse([1, 2, 0.3]), is_static=True),
            edge("odom", "base", [4, 5, 0.6]),
        ]
    )
    at = np.zeros(1, dtype=np.int64)

    for buffer in (above, below):
        T, valid = buffer.lookup("map", "base", at)
        np.testing.assert_allclose(se3.planar(T)[0], se2.compose([1, 2, 0.3], [4, 5, 0.6]))
        assert valid.all()


def test_lookup_interpolates_and_never_extrapolates():
    buffer = TransformBuffer([edge("odom", "base", [[0, 0, 0], [2, 0, 0.2]], (100, 200))])

    T, valid = buffer.lookup("odom", "base", np.array([99, 150, 201]))

    assert valid.tolist() == [False, True, False]
    np.testing.assert_allclose(se3.planar(T)[1], [1.0, 0.0, 0.1], atol=1e-5)


def test_interpolated_rotation_is_close_to_the_great_arc():
    """The claim in `Edge.at`: below 1e-5 rad for samples some degrees apart."""
    two = Rotation.from_rotvec([[0, 0, 0], np.array([0.3, -0.2, 0.9]) * 0.05])
    slerp = Slerp([0, 1000], two)
    e = Edge("a", "b", np.array([0, 1000]), np.zeros((2, 3)), two.as_quat(), is_static=False)

    T, _ = e.at(np.arange(0, 1000, 37))

    difference = Rotation.from_matrix(T[:, :3, :3]) * slerp(np.arange(0, 1000, 37)).inv()
    assert np.abs(difference.as_rotvec()).max() < 1e-5


def test_two_parents_and_cycles_are_named():
    with pytest.raises(TransformError, match="two parents"):
        TransformBuffer([edge("a", "c", [0, 0, 0]), edge("b", "c", [0, 0, 0])])
    with pytest.raises(TransformError, match="cycle"):
        TransformBuffer([edge("a", "b", [0, 0, 0]), edge("b", "a", [0, 0, 0])])


def test_unconnected_frames_are_named():
    with pytest.raises(TransformError, match="no transform between 'map' and 'base'"):
        TransformBuffer([edge("odom", "base", [0, 0, 0])]).lookup("map", "base", np.zeros(1))


def test_only_static_edges_are_fixed():
    buffer = TransformBuffer([
        edge("earth", "map", [1.0, 2.0, 0.4], is_static=True),
        edge("map", "tag", [3.0, -1.0, 1.2], is_static=True),
        edge("map", "odom", [[0, 0, 0], [2, 0, 0.2]], (100, 200)),
    ])  # fmt: skip

    found = buffer.fixed("earth", "tag")

    expected = se2.compose(np.array([1.0, 2.0, 0.4]), np.array([3.0, -1.0, 1.2]))
    np.testing.assert_allclose(se3.planar(found), expected)
    assert buffer.fixed("map", "odom") is None
    assert buffer.fixed("map", "elsewhere") is None
    np.testing.assert_array_equal(buffer.fixed("odom", "odom"), np.eye(4))


def test_a_turn_about_the_parents_axis_is_scipys():
    from scipy.spatial.transform import Rotation

    poses = Rotation.random(20, random_state=0)
    turned = se3.yawed(poses.as_quat(), 0.7)
    expected = Rotation.from_rotvec([0.0, 0.0, 0.7]) * poses

    off = (Rotation.from_quat(turned) * expected.inv()).magnitude()
    np.testing.assert_allclose(off, 0.0, atol=1e-12)
