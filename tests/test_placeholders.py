"""Placeholders: the tables keep them, a view has NaN for them, and what is an estimate stays."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slamreplay.bundle import placeholders
from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.covariance_faults import (
    ALL_ZERO,
    ASYMMETRIC,
    CONSTANT,
    INDEFINITE,
    NO_GROWTH,
    NOT_FINITE,
    NOT_GIVEN,
    OUT_OF_BOUNDS,
)
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.geometry.covariance import ros_from_planar
from slamreplay.testing.edits import rebuilt
from slamreplay.testing.synthetic import START_NS, synthetic_bundle
from slamreplay.verdict.actions import actions
from slamreplay.verdict.headings import third_witness
from slamreplay.verdict.limits import Limits

AXES = [0, 7, 35]


@pytest.fixture(scope="module")
def healthy():
    return synthetic_bundle(seconds=20.0)


def growing(n):
    cov = np.diag([1e-4, 1e-4, 1e-5]) * np.linspace(1.0, 9.0, n)[:, None, None]
    return ros_from_planar(cov)


def with_pose_covariance(bundle, change):
    table = bundle.table("poses")
    return rebuilt(bundle, {"poses": table.replace(covariance=change(table["covariance"].copy()))})


def with_odometry(bundle, **columns):
    table = bundle.table("odometry")
    sound = {"pose_covariance": growing(len(table)), "twist_covariance": growing(len(table))}
    return rebuilt(bundle, {"odometry": table.replace(**{**sound, **columns})})


def filled(value, axes=AXES):
    def change(cov):
        cov[:] = 0.0
        cov[:, axes] = value
        return cov

    return change


def negative(cov):
    cov[3:7, 1] = cov[3:7, 6] = 1.0
    return cov


def skew(cov):
    cov[3:7, 1] = 1e-4
    return cov


def infinite(cov):
    cov[3:7, 35] = np.inf
    return cov


def faults(bundle, table, column):
    judged = placeholders.judge(bundle.table(table), column, bundle.manifest.frames.map)
    return {text: int(mask.sum()) for text, mask in judged.faults.items() if mask.any()}


def test_a_sound_belief_is_the_very_same_table(healthy):
    assert healthy.evidence("poses") is healthy.table("poses")
    assert healthy.view().table("poses") is healthy.table("poses")
    assert faults(healthy, "poses", "covariance") == {}


@pytest.mark.parametrize(
    ("change", "fault", "rows"),
    [
        (filled(0.0), ALL_ZERO, 40),
        (filled(0.25), CONSTANT, 40),
        (negative, INDEFINITE, 4),
        (skew, ASYMMETRIC, 4),
        (infinite, NOT_FINITE, 4),
    ],
)
def test_covariances_of_a_belief_that_are_none(healthy, change, fault, rows):
    odd = with_pose_covariance(healthy, change)

    assert faults(odd, "poses", "covariance") == {fault: rows}
    kept, seen = odd.table("poses")["covariance"], odd.view().table("poses")["covariance"]
    assert not np.isnan(kept[:, AXES]).any()  # the table is as it was recorded
    assert np.isnan(seen[:, 35]).sum() == rows
    assert np.array_equal(odd.view().recorded("poses")["covariance"], kept)


@pytest.mark.parametrize("value", [1e-13, 1e-9, 1e5, 1e6, 1e10, 1e308])
@pytest.mark.parametrize("axis", AXES)
def test_numbers_that_only_stand_for_one_take_their_axis_away(healthy, value, axis):
    def change(cov):
        cov[:, axis] = value
        return cov

    odd = with_pose_covariance(healthy, change)
    seen = odd.view().table("poses")["covariance"]

    assert faults(odd, "poses", "covariance") == {OUT_OF_BOUNDS: 40}
    assert np.isnan(seen[:, axis]).all()
    assert np.isfinite(seen[:, [a for a in AXES if a != axis]]).all()


def test_axes_that_a_planar_robot_does_not_measure_may_say_so(healthy):
    def change(cov):
        cov[:, [14, 21, 28]] = 1e6
        return cov

    assert faults(with_pose_covariance(healthy, change), "poses", "covariance") == {}


def test_a_robot_that_stood_has_a_constant_covariance_in_good_faith(healthy):
    table = healthy.table("poses")
    cov = np.repeat(table["covariance"][:1], len(table), axis=0)
    here = {name: np.repeat(table[name][:1], len(table), axis=0)
            for name in ("position_xyz", "orientation_xyzw")}  # fmt: skip
    odd = rebuilt(healthy, {"poses": table.replace(covariance=cov, **here)})

    assert faults(odd, "poses", "covariance") == {}


def test_zeros_before_a_constant_hide_neither(healthy):
    def change(cov):
        cov = filled(0.25)(cov)
        cov[:5] = 0.0
        return cov

    found = faults(with_pose_covariance(healthy, change), "poses", "covariance")

    assert found == {ALL_ZERO: 5, CONSTANT: 35}


@given(factor=st.floats(0.3, 3.0), wobble=st.floats(0.0, 0.5))
@settings(max_examples=25, deadline=None)
def test_odometry_covariance_is_none_unless_it_grows(factor, wobble):
    bundle = synthetic_bundle(seconds=20.0)
    n = len(bundle.table("odometry"))
    scale = np.linspace(1.0, factor, n) * (1.0 + wobble * np.sin(np.arange(n)))
    cov = ros_from_planar(np.diag([1e-2, 1e-2, 1e-3]) * scale[:, None, None])
    odd = with_odometry(bundle, pose_covariance=cov)
    grown = 0.8 * factor + 0.2 > 1.5  # the last fifth against the first one, noise apart

    found = faults(odd, "odometry", "pose_covariance")

    if grown or factor < 0.9:
        assert found == ({} if grown else {NO_GROWTH: n})
    assert np.isnan(odd.view().table("odometry")["pose_covariance"]).all() == bool(found)


def test_a_pose_in_the_map_need_not_become_less_sure(healthy):
    table = healthy.table("odometry")
    cov = growing(len(table))[::-1].copy()
    in_map = rebuilt(healthy, {"odometry": table.replace(
        pose_covariance=cov, frame_id=np.full(len(table), "map", dtype=object))})  # fmt: skip

    assert faults(in_map, "odometry", "pose_covariance") == {}


@pytest.mark.parametrize("column", ["linear_velocity_xyz", "angular_velocity_xyz"])
def test_a_twist_of_zeros_while_the_robot_moved_is_none(healthy, column):
    n = len(healthy.table("odometry"))
    odd = with_odometry(healthy, **{column: np.zeros((n, 3))})

    assert faults(odd, "odometry", column) == {placeholders.FROZEN: n}
    assert np.isnan(odd.view().table("odometry")[column]).all()
    other = {"linear_velocity_xyz": "angular_velocity_xyz"}.get(column, "linear_velocity_xyz")
    assert faults(odd, "odometry", other) == {}


def imu_table(n=200, **columns):
    rng = np.random.default_rng(0)
    t = START_NS + np.arange(n) * 100_000_000
    row = {
        "t_ns": t, "t_sensor_ns": t, "t_log_ns": t + 1_000_000,
        "topic": ["/imu"] * n, "frame_id": ["base_link"] * n,
        "orientation_xyzw": np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)),
        "angular_velocity_xyz": rng.normal(0, 0.01, (n, 3)),
        "linear_acceleration_xyz": rng.normal([0, 0, 9.8], 0.01, (n, 3)),
    }  # fmt: skip
    names = ("orientation", "angular_velocity", "linear_acceleration")
    row |= {f"{name}_covariance": np.tile(np.eye(3).ravel() * 1e-5, (n, 1)) for name in names}
    return Table(TABLES["imu"], {**row, **columns})


def test_an_imus_constant_noise_is_what_its_maker_says(healthy):
    odd = rebuilt(healthy, {"imu": imu_table()})

    assert odd.evidence("imu") is odd.table("imu")


def test_what_an_imu_does_not_measure(healthy):
    marked = np.tile(np.eye(3).ravel(), (200, 1))
    marked[:7, 0] = -1.0
    imu = imu_table(
        orientation_covariance=np.zeros((200, 9)),
        linear_acceleration_covariance=marked,
        angular_velocity_xyz=np.tile([0.0, 0.0, 0.02], (200, 1)),
    )
    odd = rebuilt(healthy, {"imu": imu})

    assert faults(odd, "imu", "orientation_covariance") == {ALL_ZERO: 200}
    assert faults(odd, "imu", "linear_acceleration_covariance") == {NOT_GIVEN: 7}
    assert faults(odd, "imu", "angular_velocity_xyz") == {placeholders.FROZEN: 200}
    assert np.isnan(odd.view().table("imu")["angular_velocity_xyz"]).all()
    assert (odd.table("imu")["angular_velocity_xyz"][:, 2] == 0.02).all()


# --- nothing is passed on as if it were measured ----------------------------------------------


def test_a_dead_gyro_is_no_witness_that_the_robot_never_turned(healthy):
    from slamreplay.bundle.odometry import odometry_track
    from slamreplay.verdict.headings import Heading

    def witness(imu):
        role = healthy.manifest.roles[0].model_copy(update={"role": "imu", "topic": "/imu"})
        told = healthy.manifest.model_copy(update={"roles": [*healthy.manifest.roles, role]})
        bundle = rebuilt(healthy, {"imu": imu})
        bundle.manifest = told
        track = odometry_track(bundle.view())
        return third_witness(bundle.view(), Heading(track.t_ns, np.unwrap(track.xyyaw[:, 2])))[0]

    assert witness(imu_table()) == "IMU"
    assert witness(imu_table(angular_velocity_xyz=np.zeros((200, 3)))) != "IMU"


@pytest.mark.parametrize("change", [filled(0.0), filled(0.25), filled(1e6)])
def test_the_gate_does_not_let_an_action_pass_on_a_placeholder(healthy, change):
    odd = with_pose_covariance(healthy, change)
    times = np.array([START_NS + 5_000_000_000, START_NS + 12_000_000_000])
    stop = Table(TABLES["recoveries"], {
        "t_ns": times, "t_sensor_ns": times, "t_log_ns": times, "topic": ["/bt"] * 2,
        "name": ["Spin"] * 2, "status": ["running"] * 2, "goal": [""] * 2,
        "source": ["behavior_tree"] * 2,
    })  # fmt: skip

    def judged(bundle):
        view = bundle.view().with_table(stop)
        belief = recorded_belief(view, view.role("scan").t_ns)
        return [a for a in actions(view, belief, Limits()) if a.kind == "recovery"]

    assert all(a.allowed is not None and a.sigma_m is not None for a in judged(healthy))
    for action in judged(odd):
        assert (action.allowed, action.sigma_m) == (None, None)
        assert "no covariance" in action.belief.lacks
