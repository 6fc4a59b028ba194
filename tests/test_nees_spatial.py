"""NEES in space: against gtsam and scipy, far from the origin and turned about all axes."""

import gtsam
import numpy as np
import pytest
from beliefs import ar1
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from slamreplay.bundle.manifest import Clock, Frames, Manifest, Role
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import Bundle
from slamreplay.consistency.asking import ask
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence.nees_spatial import spatial_errors
from slamreplay.consistency.evidence.published import published_belief
from slamreplay.consistency.evidence.references import references_of
from slamreplay.consistency.evidence.source import MAP_AXES, SPATIAL_AXES
from slamreplay.consistency.evidence.spatial_track import SpatialTrack
from slamreplay.consistency.statistics.whitening import whitened
from slamreplay.geometry import se3
from slamreplay.geometry.covariance import gtsam_from_ros, ros_from_gtsam, ros_turned

SECOND = 1_000_000_000
FAR = se3.matrix([1203.0, -870.0, 41.0], Rotation.from_euler("zyx", [2.1, -0.4, 0.7]).as_quat())
_A = np.random.default_rng(11).standard_normal((6, 6)) * [0.2, 0.3, 0.1, 0.02, 0.01, 0.03]
COV = _A.T @ _A + np.diag([0.01, 0.02, 0.03, 1e-4, 4e-4, 2e-4])


def erring(T, error):
    """Poses (N, 4, 4) of T off by errors (N, 6): position and rotation vector, parent axes."""
    R = Rotation.from_rotvec(error[:, 3:]).as_matrix() @ T[..., :3, :3]
    return se3.from_parts(R, T[..., :3, 3] + error[:, :3])


def track(T, cov=None, frame="map"):
    n = len(T)
    cov = np.full((6, 6), np.nan) if cov is None else cov
    t = np.arange(n, dtype=np.int64) * SECOND // 10
    return SpatialTrack(frame, t, T, np.broadcast_to(cov, (n, 6, 6)))


def nees(error, cov, axes=slice(None)):
    white = whitened(error[:, axes], cov[:, axes, axes])
    return (white**2).sum(axis=1)


# --- against gtsam and scipy -----------------------------------------------------------------


def test_mean_nees_is_the_degrees_of_freedom_and_a_wrong_order_is_off_by_far():
    rng = np.random.default_rng(0)
    error = rng.standard_normal((4000, 6)) @ np.linalg.cholesky(COV).T
    truth = np.broadcast_to(FAR, (4000, 4, 4))
    got, cov = spatial_errors(track(erring(truth, error), COV), track(truth), SECOND)

    assert nees(got, cov).mean() == pytest.approx(6.0, abs=0.2)
    assert nees(got, cov, slice(0, 3)).mean() == pytest.approx(3.0, abs=0.15)
    assert nees(got, cov, slice(3, 6)).mean() == pytest.approx(3.0, abs=0.15)
    rotation_first = gtsam_from_ros(cov, np.eye(3))
    assert nees(got, rotation_first).mean() > 500
    body = gtsam_from_ros(cov, FAR[:3, :3])[:, [3, 4, 5, 0, 1, 2]][:, :, [3, 4, 5, 0, 1, 2]]
    assert nees(got, body).mean() > 10  # the right order about the wrong axes


def test_beliefs_drawn_by_gtsam_are_consistent():
    # Errors in gtsam's own tangent of the body, its covariance converted to ROS's.
    rng = np.random.default_rng(1)
    body = gtsam_from_ros(COV, FAR[:3, :3])
    mean = gtsam.Pose3(FAR)
    drawn = rng.standard_normal((3000, 6)) @ np.linalg.cholesky(body).T
    T = np.stack([mean.retract(xi).matrix() for xi in drawn])
    got, cov = spatial_errors(
        track(T, ros_from_gtsam(body, FAR[:3, :3])),
        track(np.broadcast_to(FAR, (3000, 4, 4))),
        SECOND,
    )

    assert nees(got, cov).mean() == pytest.approx(6.0, abs=0.25)


def test_row_by_row_it_is_the_nees_of_gtsams_local_coordinates():
    rng = np.random.default_rng(2)
    small = rng.standard_normal((50, 6)) @ np.linalg.cholesky(1e-6 * COV).T
    T = erring(np.broadcast_to(FAR, (50, 4, 4)), small)
    got, cov = spatial_errors(track(T, 1e-6 * COV), track(np.broadcast_to(FAR, (50, 4, 4))), SECOND)
    body = np.linalg.inv(gtsam_from_ros(1e-6 * COV, FAR[:3, :3]))
    for k in range(50):
        xi = gtsam.Pose3(FAR).localCoordinates(gtsam.Pose3(T[k]))
        assert nees(got, cov)[k] == pytest.approx(xi @ body @ xi, rel=1e-3)


@given(
    st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda v: np.linalg.norm(v) > 0.05),
    st.one_of(st.floats(0.0, np.pi - 1e-9), st.sampled_from([0.0, 1e-12, 1e-5, np.pi - 1e-6])),
)
def test_rotation_vectors_are_scipys(axis, angle):
    vector = np.array(axis) / np.linalg.norm(axis) * angle
    R = Rotation.from_rotvec(vector).as_matrix()

    np.testing.assert_allclose(se3.rotation_vector(R), vector, atol=1e-7)
    np.testing.assert_allclose(se3.rotation_from_vector(vector), R, atol=1e-12)


def test_half_turns_have_an_axis_and_nan_stays_nan():
    for axis in np.vstack([np.eye(3), [[0.6, 0.0, 0.8], [-0.6, 0.8, 0.0]]]):
        got = se3.rotation_vector(2 * np.outer(axis, axis) - np.eye(3))
        np.testing.assert_allclose(np.abs(got @ axis), np.pi, rtol=1e-12)
    assert np.isnan(se3.rotation_vector(np.full((2, 3, 3), np.nan))).all()


def test_poses_between_samples_turn_steadily_and_gaps_are_not_crossed():
    rng = np.random.default_rng(3)
    T = se3.matrix(rng.standard_normal((5, 3)), rng.standard_normal((5, 4)))
    t = np.array([0, 1, 2, 3, 9], dtype=np.int64) * SECOND
    reference = SpatialTrack("map", t, T, np.broadcast_to(COV, (5, 6, 6)))
    at = np.array([0.0, 0.25, 1.5, 3.0, 5.0, 9.0, 9.1]) * SECOND
    got = reference.at(at.astype(np.int64), SECOND)
    known = [0, 1, 2, 3, 5]
    slerp = Slerp(t / SECOND, Rotation.from_matrix(T[:, :3, :3]))

    assert np.flatnonzero(np.isfinite(got.T).all(axis=(1, 2))).tolist() == known
    np.testing.assert_allclose(
        got.T[known, :3, :3], slerp(at[known] / SECOND).as_matrix(), atol=1e-12
    )
    np.testing.assert_allclose(got.T[1, :3, 3], 0.75 * T[0, :3, 3] + 0.25 * T[1, :3, 3])


def test_another_frame_on_the_robot_has_gtsams_covariance():
    mount = se3.matrix([[0.4, -1.2, 0.9]], Rotation.from_euler("xyz", [[0.3, 0.5, -1.0]]).as_quat())
    moved = track(FAR[None], COV).mounted(mount)
    adjoint = gtsam.Pose3(mount[0]).inverse().AdjointMap()
    expected = adjoint @ gtsam_from_ros(COV, FAR[:3, :3]) @ adjoint.T

    np.testing.assert_allclose(moved.T[0], FAR @ mount[0])
    np.testing.assert_allclose(
        moved.cov[0], ros_from_gtsam(expected, moved.T[0, :3, :3]), rtol=1e-9, atol=1e-15
    )


@given(st.integers(0, 10_000))
def test_moving_the_world_changes_no_nees(seed):
    rng = np.random.default_rng(seed)
    world = se3.matrix(rng.uniform(-100, 100, 3), rng.standard_normal(4))
    truth = se3.matrix(rng.standard_normal((20, 3)), rng.standard_normal((20, 4)))
    belief = erring(truth, rng.standard_normal((20, 6)) @ np.linalg.cholesky(COV).T)
    one = spatial_errors(track(belief, COV), track(truth, COV), SECOND)
    turned = ros_turned(COV, world[:3, :3])
    two = spatial_errors(track(world @ belief, turned), track(world @ truth, turned), SECOND)

    np.testing.assert_allclose(nees(*two), nees(*one), rtol=1e-6)


# --- from a log ------------------------------------------------------------------------------


def flight(n=600):
    """Where something that climbs, rolls and pitches is."""
    s = np.arange(n) / 10.0
    angles = np.column_stack([0.3 * s, 0.2 * np.sin(s), 0.3 * np.cos(0.7 * s)])
    xyz = np.column_stack([40.0 + s, np.sin(s), 3.0 + np.cos(0.5 * s)])
    return se3.matrix(xyz, Rotation.from_euler("zyx", angles).as_quat())


def rows(name, T, cov, scale=1.0, **columns):
    n = len(T)
    t = np.arange(n, dtype=np.int64) * SECOND // 10
    quaternion = Rotation.from_matrix(T[:, :3, :3]).as_quat()
    columns |= dict.fromkeys(("t_ns", "t_sensor_ns", "t_log_ns"), t)
    columns |= {
        "topic": [f"/{name}"] * n,
        "frame_id": ["map"] * n,
        "child_frame_id": ["base"] * n,
        "position_xyz": T[:, :3, 3],
        "orientation_xyzw": scale * quaternion,
        "covariance": np.broadcast_to(cov, (n, 6, 6)).reshape(n, 36),
    }
    return Table(TABLES[name], columns)


def log(belief, reference):
    end = int(belief.t_ns[-1])
    topic = str(belief["topic"][0])
    manifest = Manifest(
        bundle_id="space", sources=[], options={}, start_ns=0, end_ns=end,
        clock=Clock(name="sensor", reason="test", knots=[(0, 0), (end, end)]),
        frames=Frames(map="map", odom=None, base="base", tree=[]),
        roles=[Role(role="pose", topic=topic, type="t", messages=1, reason="r")],
        missing=[], maps=[], losses=[], tables={},
    )  # fmt: skip
    return Bundle(manifest, {"poses": belief, "references": reference}, {})


def asked(bundle):
    view = bundle.view()
    return CheckContext(published_belief(view), references_of(bundle, None), view)


def made(sigma=(1.0,) * 6, rho=0.5, truth_cov=None, breath=0.3, seed=0, quaternion=1.0):
    """A belief whose errors have covariance COV, that claims `sigma` times as much."""
    T = flight()
    error = ar1(np.random.default_rng(seed), len(T), rho, 6) @ np.linalg.cholesky(COV).T
    height = 1.0 + breath * np.sin(np.arange(len(T)) / 7.0)
    belief = erring(T, error * height[:, None])
    claimed = np.diag(sigma) @ COV @ np.diag(sigma) * height[:, None, None] ** 2
    poses = rows("poses", belief, claimed, quaternion, source=["/poses"] * len(T))
    truth_cov = np.full((6, 6), np.nan) if truth_cov is None else truth_cov
    kind = ["motion_capture"] * len(T)
    return log(poses, rows("references", T, truth_cov, kind=kind))


def test_a_consistent_belief_in_space_is_judged_in_six_axes_and_left_alone():
    context = asked(made())
    (evidence,) = context.evidence

    assert evidence.axes == SPATIAL_AXES
    assert ask([context], ["nees", "distribution", "credibility_index", "collapse"]) == []
    assert nees(evidence.error, evidence.cov).mean() == pytest.approx(6.0, abs=0.5)


def test_of_a_rotation_that_is_too_sure_of_itself_the_rotation_is_told():
    (finding,) = ask([asked(made(sigma=(1, 1, 1, 0.3, 0.3, 0.3)))], ["nees"])

    assert (finding.id, finding.severity) == ("SR-CON-001", "error")
    assert "the rotation is too small by a factor of 3." in finding.message
    assert "deg" in finding.message
    assert finding.value == pytest.approx(3 / 0.09, rel=0.2)


def test_quaternions_need_not_be_normalised():
    even, odd = asked(made()), asked(made(quaternion=3.7))

    np.testing.assert_allclose(odd.evidence[0].error, even.evidence[0].error, atol=1e-9)


def test_the_references_covariance_is_added():
    exact, vague = asked(made()), asked(made(truth_cov=3 * COV))

    np.testing.assert_allclose(vague.evidence[0].cov, exact.evidence[0].cov + 3 * COV)


def test_what_stays_in_a_plane_is_judged_in_the_plane():
    flat = flight()
    flat[:, :3, :3] = Rotation.from_euler("z", np.arange(600)[:, None] / 30.0).as_matrix()
    flat[:, 2, 3] = 0.0
    constant = np.broadcast_to(COV, (600, 6, 6)).copy()
    constant[:, :2, :2] *= (1.0 + 0.1 * np.sin(np.arange(600)))[:, None, None]
    zeros = np.zeros((600, 6, 6))
    zeros[:, [0, 1, 5], [0, 1, 5]] = COV[[0, 1, 5], [0, 1, 5]]
    zeros[:, 0, 0] *= 1.0 + 0.1 * np.sin(np.arange(600))
    breathing = COV * (1.0 + 0.1 * np.sin(np.arange(600)))[:, None, None]
    unmeasured = breathing.copy()
    unmeasured[:, 2, 2] = 1e6 + np.arange(600)
    kind = ["motion_capture"] * 600
    truth = rows("references", flight(), np.full((6, 6), np.nan), kind=kind)
    planar_truth = rows("references", flat, np.full((6, 6), np.nan), kind=kind)

    def axes(T, cov, reference):
        belief = rows("poses", T, cov, source=["/poses"] * 600)
        return asked(log(belief, reference)).evidence[0].axes

    assert axes(flight(), breathing, truth) == SPATIAL_AXES
    assert axes(flat, breathing, truth) == MAP_AXES  # it never leaves the plane
    assert axes(flight(), zeros, truth) == MAP_AXES  # AMCL's covariance
    assert axes(flight(), constant, truth) == MAP_AXES  # z, roll and pitch are a constant
    assert axes(flight(), unmeasured, truth) == MAP_AXES
    assert axes(flight(), breathing, planar_truth) == MAP_AXES


def test_an_estimator_is_not_judged_by_the_robots_poses_in_space():
    bundle = made()
    view = bundle.view()
    track = published_belief(view)
    other = type(track)("map", "base", track.t_ns, track.xyyaw, 2.0 * track.cov)
    context = CheckContext(other, references_of(bundle, None), view, "mine")

    assert context.evidence[0].axes == MAP_AXES


def test_rows_without_a_reference_or_a_sound_covariance_are_left_out():
    bundle = made()
    poses = bundle.table("poses")
    cov = poses["covariance"].copy()
    cov[5, 14] = -1.0  # of z
    cov[9, 35] = 4.0  # of rz: any heading would do
    bundle = log(poses.replace(covariance=cov), bundle.table("references").take(np.arange(400)))
    (evidence,) = asked(bundle).evidence
    known = np.isfinite(whitened(evidence.error, evidence.cov)).all(axis=1)

    assert evidence.axes == SPATIAL_AXES
    assert np.isfinite(evidence.error[9, :3]).all()
    assert np.flatnonzero(~known).tolist() == [5, 9, *range(400, 600)]
