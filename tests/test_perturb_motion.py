"""Odometry and inertial units, changed: by as much as is said, however a log tells them."""

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slamreplay.bundle.odometry import odometry_track, topic_track
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.errors import NotApplicableError
from slamreplay.estimators.dead_reckoning import DeadReckoning
from slamreplay.estimators.ekf.gyro import gyro_of
from slamreplay.geometry import se2, se3
from slamreplay.perturb import PERTURBATIONS
from slamreplay.perturb.odometry_path import retold
from slamreplay.testing import edits
from slamreplay.testing.synthetic import START_NS, synthetic_bundle

BUNDLE = synthetic_bundle(seconds=20.0, with_imu=True)


def perturbed(text: str, level: float, view=None, seed: int = 0):
    name, _, variant = text.partition(".")
    rng = np.random.Generator(np.random.PCG64(seed))
    return PERTURBATIONS.load(name)().apply(view or BUNDLE.view(), variant, level, rng)


def without_tf(view):
    transforms = view.table("transforms")
    return view.with_table(transforms.take(transforms["child_frame"] != "base_link"))


def without_topic(view):
    return view.with_table(Table.empty(view.table("odometry").schema))


def upside_down(view):
    """The same log with base -> odom on tf, and without map -> odom, which would not fit it."""
    transforms = view.table("transforms")
    transforms = transforms.take(transforms["parent_frame"] != "map")
    own = transforms["child_frame"] == "base_link"
    T = se3.matrix(transforms["translation_xyz"][own], transforms["rotation_xyzw"][own])
    back = se3.inverse(T)
    columns = {n: transforms[n].copy() for n in ("parent_frame", "child_frame", "translation_xyz",
                                                 "rotation_xyzw")}  # fmt: skip
    columns["parent_frame"][own], columns["child_frame"][own] = "base_link", "odom"
    columns["translation_xyz"][own] = back[:, :3, 3]
    columns["rotation_xyzw"][own] = se3.quaternion(back[:, :3, :3])
    return view.with_table(transforms.replace(**columns))


#: Perturbations of how the robot moves, and of conventions.
MINE = (
    "frame_swap", "gyro_bias", "handedness", "imu_drop", "odometry_drop", "odometry_noise",
    "odometry_scale", "odometry_slip", "quaternion_order", "unit_error",
)  # fmt: skip

SHAPES = {
    "both": lambda view: view,
    "topic": without_tf,
    "tf": without_topic,
    "upside down": upside_down,
}


def path(view):
    return odometry_track(view).xyyaw


def length(xyyaw) -> float:
    return float(np.hypot(*np.diff(xyyaw[:, :2], axis=0).T).sum())


def turned(xyyaw) -> float:
    return float(se2.wrap_angle(np.diff(xyyaw[:, 2])).sum())


CHANGED = [
    ("odometry_scale.translation", 1.3),
    ("odometry_scale.rotation", 0.8),
    ("odometry_slip.window", 0.7),
    ("odometry_slip.window", -0.7),
    ("odometry_slip.turn", 40.0),
    ("odometry_slip.per_turn", 0.3),
    ("odometry_noise.distance", 0.05),
    ("odometry_noise.heading", 3.0),
]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("text", "level"), CHANGED)
def test_however_a_log_tells_odometry_it_is_changed_alike(text, level, shape):
    plain = path(perturbed(text, level))
    other = path(perturbed(text, level, SHAPES[shape](BUNDLE.view())))

    np.testing.assert_allclose(other[:, :2], plain[:, :2], atol=1e-9)
    np.testing.assert_allclose(se2.wrap_angle(other[:, 2] - plain[:, 2]), 0.0, atol=1e-9)
    assert np.abs(other - path(BUNDLE.view()))[:, :2].max() > 0.05


def tilted(view):
    """The same way on a slope: with height, roll and pitch."""
    table = view.table("transforms")
    own = table["child_frame"] == "base_link"
    count = int(own.sum())
    rng = np.random.default_rng(3)
    xyz, turn = table["translation_xyz"].copy(), table["rotation_xyzw"].copy()
    yaw = se3.yaw_from_quaternion(turn[own])
    xyz[own, 2] = rng.normal(0.0, 0.3, count)
    turn[own] = se3.quaternion_from_rpy(*rng.normal(0.0, 0.1, (2, count)), yaw)
    return view.with_table(table.replace(translation_xyz=xyz, rotation_xyzw=turn))


@pytest.mark.parametrize("shape", ["tf", "upside down"])
def test_height_roll_and_pitch_stay(shape):
    view = SHAPES[shape](tilted(BUNDLE.view()))
    at = np.arange(START_NS + 10**9, START_NS + 15 * 10**9, 10**8)

    after = perturbed("odometry_scale.rotation", 0.7, view)

    before, T = (v.transforms.lookup("odom", "base_link", at)[0] for v in (view, after))
    np.testing.assert_allclose(T[:, 2, 3], before[:, 2, 3], atol=1e-6)
    np.testing.assert_allclose(T[:, 2, :3], before[:, 2, :3], atol=1e-6)  # where up is in the base


@pytest.mark.parametrize(("text", "level"), CHANGED)
def test_tf_and_topic_tell_the_same_although_their_rows_come_at_other_times(text, level):
    table = BUNDLE.table("odometry")
    sparse = BUNDLE.view().with_table(table.take(np.arange(0, len(table), 3)))

    view = perturbed(text, level, sparse)

    topic = topic_track(view, view.table("odometry"))
    tf = odometry_track(view).at(topic.t_ns)
    assert np.hypot(*(topic.xyyaw - tf.xyyaw)[:, :2].T).max() < 0.01
    assert np.abs(se2.wrap_angle((topic.xyyaw - tf.xyyaw)[:, 2])).max() < 0.01


@pytest.mark.parametrize("text", ["odometry_slip.turn", "odometry_scale.rotation"])
def test_velocities_are_those_of_the_path_that_is_told(text):
    level = {"odometry_slip.turn": 30.0, "odometry_scale.rotation": 1.4}[text]
    table = perturbed(text, level).table("odometry")

    yaw = np.unwrap(se3.yaw_from_quaternion(table["orientation_xyzw"]))
    np.testing.assert_allclose(
        np.trapezoid(table["angular_velocity_xyz"][:, 2], dx=0.05), yaw[-1] - yaw[0], atol=0.06
    )


def test_a_slip_tells_so_many_metres_more_or_less_at_one_place():
    plain = path(BUNDLE.view())
    for level in (0.5, 3.0, -0.5, -3.0):
        slipped = path(perturbed("odometry_slip.window", level, seed=3))
        assert length(slipped) - length(plain) == pytest.approx(level, abs=1e-6)
        assert turned(slipped) == pytest.approx(turned(plain))
        steps = np.abs(np.diff(slipped, axis=0) - np.diff(plain, axis=0))[:, :2].max(axis=1)
        changed = np.flatnonzero(steps > 1e-9)
        assert len(changed) == changed[-1] - changed[0] + 1  # one stretch, nothing elsewhere


@given(
    u=st.integers(0, 1000),
    levels=st.lists(st.floats(0.1, 9.0), min_size=2, max_size=2, unique=True),
)
@settings(max_examples=20, deadline=None)
def test_a_longer_slip_contains_the_shorter_one_of_the_same_seed(u, levels):
    plain = np.diff(path(BUNDLE.view()), axis=0)[:, :2]

    def slipping(level):
        step = np.diff(path(perturbed("odometry_slip.window", level, seed=u)), axis=0)[:, :2]
        return np.hypot(*(step - plain).T) > 1e-6 + 1e-3 * np.hypot(*plain.T)

    short, long = (slipping(level) for level in sorted(levels))
    assert (long | ~short).all()


def test_a_slip_longer_than_the_way_is_not_applicable():
    with pytest.raises(NotApplicableError, match=r"drives .* m in this log"):
        perturbed("odometry_slip.window", 50.0)


def test_a_turn_that_was_not_made_is_told_within_a_third_of_a_metre():
    plain = path(BUNDLE.view())
    slipped = path(perturbed("odometry_slip.turn", 25.0))

    more = np.degrees(se2.wrap_angle(slipped[:, 2] - plain[:, 2]))
    assert more[-1] == pytest.approx(25.0)
    assert length(slipped) == pytest.approx(length(plain))
    between = (more > 1e-6) & (more < 25.0 - 1e-6)
    assert length(plain[between]) < 0.31
    assert np.ptp(np.flatnonzero(between)) == np.count_nonzero(between) - 1


def test_a_share_of_every_turn_slips_only_while_the_robot_turns():
    straight = np.column_stack([np.arange(101) * 0.05, np.zeros(101), np.arange(101) * 1e-3])
    left = straight[-1] + np.column_stack([np.zeros((50, 2)), np.arange(1, 51) * 0.03])
    table = BUNDLE.table("odometry").take(np.arange(151))
    xyyaw = np.concatenate([straight, left])
    table = table.replace(
        position_xyz=np.column_stack([xyyaw[:, :2], np.zeros(151)]),
        orientation_xyzw=se3.quaternion_from_yaw(xyyaw[:, 2]),
    )
    view = without_tf(BUNDLE.view()).with_table(table)

    after = np.unwrap(path(perturbed("odometry_slip.per_turn", -0.5, view))[:, 2])

    np.testing.assert_allclose(after[:98], straight[:98, 2], atol=1e-9)
    assert after[-1] - after[101] == pytest.approx(0.5 * (49 * 0.03), abs=1e-6)


def test_noise_of_odometry_grows_with_the_root_of_the_way():
    plain = path(BUNDLE.view())
    off = []
    for seed in range(60):
        noisy = path(perturbed("odometry_noise.distance", 0.02, seed=seed))
        off.append(length(noisy) - length(plain))
    assert np.std(off) == pytest.approx(0.02 * np.sqrt(length(plain)), rel=0.3)

    turns = [
        np.degrees(
            se2.wrap_angle(
                path(perturbed("odometry_noise.heading", 2.0, seed=seed))[-1, 2] - plain[-1, 2]
            )
        )
        for seed in range(60)
    ]
    assert np.std(turns) == pytest.approx(2.0 * np.sqrt(length(plain)), rel=0.3)
    assert abs(np.mean(turns)) < 3.0


def test_more_noise_of_the_same_seed_is_the_same_noise():
    plain = path(BUNDLE.view())[:, 2]
    one, two = (
        se2.wrap_angle(path(perturbed("odometry_noise.heading", v))[:, 2] - plain) for v in (1, 2)
    )
    np.testing.assert_allclose(two, 2.0 * one, atol=1e-9)


@given(
    turns=st.lists(st.floats(-2.0, 2.0), min_size=1, max_size=20),
    ratio=st.floats(0.1, 3.0),
)
@settings(max_examples=30, deadline=None)
def test_a_path_told_anew_has_the_lengths_and_turns_that_were_asked_for(turns, ratio):
    rng = np.random.default_rng(0)
    xyyaw = np.cumsum(rng.normal(0.0, 0.3, (len(turns) + 1, 3)), axis=0)

    after = retold(xyyaw, ratio, np.array(turns))

    step = np.hypot(*np.diff(after[:, :2], axis=0).T)
    np.testing.assert_allclose(step, ratio * np.hypot(*np.diff(xyyaw[:, :2], axis=0).T))
    np.testing.assert_allclose(np.diff(after[:, 2]), turns, atol=1e-9)
    np.testing.assert_allclose(after[0], xyyaw[0])


def odometry_times(view):
    transforms = view.table("transforms")
    on_tf = transforms.t_ns[transforms["child_frame"] == "base_link"]
    return view.table("odometry").t_ns.tolist(), on_tf.tolist()


def test_a_message_of_odometry_that_is_lost_is_lost_on_tf_and_topic():
    topic, tf = odometry_times(perturbed("odometry_drop.random", 0.4))

    assert topic == tf
    assert 200 < len(topic) < 280
    more, _ = odometry_times(perturbed("odometry_drop.random", 0.7))
    assert set(more) < set(topic)
    others = BUNDLE.table("transforms")["child_frame"] != "base_link"
    after = perturbed("odometry_drop.random", 0.4).table("transforms")
    assert np.count_nonzero(after["child_frame"] != "base_link") == np.count_nonzero(others)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_burst_without_odometry_is_one_gap_in_which_nothing_is_known(shape):
    view = perturbed("odometry_drop.burst", 3.0, SHAPES[shape](BUNDLE.view()))
    track = odometry_track(view)

    gaps = np.diff(track.t_ns) / 1e9
    assert np.count_nonzero(gaps > 0.06) == 1
    assert gaps.max() == pytest.approx(3.05, abs=0.051)
    gap = int(np.argmax(gaps))
    assert np.isnan(track.at(track.t_ns[gap : gap + 1] + 10**9).xyyaw).all()
    with pytest.raises(NotApplicableError, match="shorter than 30 s"):
        perturbed("odometry_drop.burst", 30.0)


def scattered(bundle):
    """The same log, its rows in any order."""
    rng = np.random.default_rng(1)
    tables = {}
    for name in ("odometry", "imu", "transforms"):
        table = bundle.table(name)
        tables[name] = table.take(rng.permutation(len(table)))
    return edits.rebuilt(bundle, tables)


@pytest.mark.parametrize(("text", "level"), CHANGED)
def test_the_order_of_rows_is_of_no_matter(text, level):
    plain, other = (perturbed(text, level, b.view()) for b in (BUNDLE, scattered(BUNDLE)))

    for one in (path, lambda view: topic_track(view, view.table("odometry")).xyyaw):
        np.testing.assert_allclose(one(other), one(plain), atol=1e-9)


def damaged():
    bundle = synthetic_bundle(seconds=6.0, with_imu=True)
    t_ns = bundle.table("scans").t_ns
    rng = np.random.default_rng(0)
    columns = {
        "odometry": ("position_xyz", "orientation_xyzw"),
        "transforms": ("translation_xyz", "rotation_xyzw"),
        "imu": ("angular_velocity_xyz", "orientation_xyzw"),
        "initial_poses": ("orientation_xyzw",),
    }

    def filled(value, share):
        tables = {}
        for name, them in columns.items():
            table = bundle.table(name)
            spoilt = {column: table[column].copy() for column in them}
            for numbers in spoilt.values():
                numbers[rng.random(len(numbers)) < share] = value
            tables[name] = table.replace(**spoilt)
        return edits.rebuilt(bundle, tables)

    return {
        "a gap": edits.with_gap(bundle, int(t_ns[15]), int(t_ns[45])),
        "repeated stamps": edits.with_repeated_stamps(bundle),
        "NaN": filled(np.nan, 0.2),
        "zeros": filled(0.0, 1.0),
        "far off": filled(1e150, 0.2),
        "one row": edits.rebuilt(
            bundle, {n: bundle.table(n).take(np.arange(1)) for n in ("odometry", "imu", "scans")}
        ),
        "nothing": edits.rebuilt(bundle, {n: Table.empty(TABLES[n]) for n in TABLES}),
    }


@pytest.mark.parametrize("damage", damaged().items(), ids=lambda pair: pair[0])
def test_damaged_logs_are_changed_or_refused_with_a_line(damage):
    view = damage[1].view()
    for name in MINE:
        for variant, about in PERTURBATIONS.load(name).variants.items():
            level = 1.0 if about.is_switch else min(0.5, about.high)
            with suppress(NotApplicableError):
                perturbed(f"{name}.{variant}", level, view)


def test_what_is_not_there_cannot_be_changed():
    bare = without_topic(without_tf(BUNDLE.view()))
    for text, level in (*CHANGED, ("odometry_drop.random", 0.5), ("odometry_drop.burst", 1.0)):
        with pytest.raises(NotApplicableError, match="no odometry"):
            perturbed(text, level, bare)
    still = synthetic_bundle(seconds=2.0).view()
    for text in ("gyro_bias.yaw", "imu_drop.random", "imu_drop.burst"):
        with pytest.raises(NotApplicableError, match="no IMU"):
            perturbed(text, 0.5, still)


def test_a_robot_that_stands_neither_slips_nor_scatters():
    table, transforms = BUNDLE.table("odometry"), BUNDLE.table("transforms")
    still = table.replace(
        position_xyz=np.zeros_like(table["position_xyz"]),
        orientation_xyzw=np.tile([0.0, 0.0, 0.0, 1.0], (len(table), 1)),
    )
    view = without_tf(BUNDLE.view().with_table(transforms)).with_table(still)
    for text, level in CHANGED:
        if not text.startswith("odometry_scale"):
            with pytest.raises(NotApplicableError, match=r"does not|drives 0 m"):
                perturbed(text, level, view)


def test_two_ways_about_a_third_frame_are_no_odometry_that_could_be_changed():
    transforms = BUNDLE.table("transforms")
    parent, child = transforms["parent_frame"].copy(), transforms["child_frame"].copy()
    parent[child == "base_link"] = "map"

    view = BUNDLE.view().with_table(transforms.replace(parent_frame=parent, child_frame=child))

    with pytest.raises(NotApplicableError, match="third frame"):
        perturbed("odometry_scale.translation", 1.1, view)


@pytest.mark.parametrize("level", [2.0, -0.5])
def test_a_gyroscope_with_a_bias_gains_so_many_degrees_each_second(level):
    plain, biased = gyro_of(BUNDLE.view()), gyro_of(perturbed("gyro_bias.yaw", level))

    seconds = (plain.t_ns - START_NS) / 1e9
    np.testing.assert_allclose(np.degrees(biased.turn - plain.turn), level * seconds, atol=1e-9)


def test_an_orientation_of_the_unit_gains_the_bias_as_well():
    table = BUNDLE.table("imu")
    silent = table.replace(
        angular_velocity_xyz=np.full((len(table), 3), np.nan),
        orientation_covariance=np.tile(1e-4 * np.eye(3).ravel(), (len(table), 1)),
    )
    view = BUNDLE.view().with_table(silent)

    turn = gyro_of(perturbed("gyro_bias.yaw", 3.0, view)).turn - gyro_of(view).turn

    assert np.degrees(turn[-1]) == pytest.approx(3.0 * 19.98)


def test_inertial_measurements_are_lost_in_one_burst_or_here_and_there():
    burst = perturbed("imu_drop.burst", 4.0).table("imu").t_ns
    assert np.diff(burst).max() / 1e9 == pytest.approx(4.02, abs=0.021)
    some = set(perturbed("imu_drop.random", 0.5).table("imu").t_ns.tolist())
    few = set(perturbed("imu_drop.random", 0.8).table("imu").t_ns.tolist())
    assert few < some
    assert 400 < len(some) < 600


def test_what_levels_a_unit_of_unknown_mount_is_not_lost_with_an_exchange():
    table, transforms = BUNDLE.table("imu"), BUNDLE.table("transforms")
    frozen = np.tile([0.0, 0.0, -9.8], (len(table), 1))  # a placeholder to a view, and still down
    bundle = synthetic_bundle(seconds=20.0, with_imu=True)
    bundle._tables["imu"] = table.replace(linear_acceleration_xyz=frozen)
    bundle._tables["transforms"] = transforms.take(transforms["child_frame"] != "imu")

    biased = gyro_of(perturbed("gyro_bias.yaw", 1.0, bundle.view()))

    gained = biased.turn[-1] - gyro_of(bundle.view()).turn[-1]
    assert np.degrees(gained) == pytest.approx(19.98)


def test_a_view_that_leaves_out_what_the_localizer_said_has_no_start_from_it():
    """Its other tables are exchanged, too: that does not bring the recorded belief back."""
    view = BUNDLE.view()
    transforms = view.table("transforms")
    alone = view.with_table(transforms.take(transforms["parent_frame"] != "map"))
    for name in ("initial_poses", "poses"):
        alone = alone.with_table(Table.empty(TABLES[name]))

    run = DeadReckoning().run(alone, seed=0).track

    assert run.frame_id == "odom"
    assert DeadReckoning().run(view, seed=0).track.frame_id == "map"
