"""What is done to scans, stamps and mounts is what the level says, and nothing else."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.tables import Ragged, Table
from slamreplay.bundle.view import Bundle
from slamreplay.errors import NotApplicableError
from slamreplay.geometry import se2
from slamreplay.perturb import PERTURBATIONS
from slamreplay.testing.edits import rebuilt
from slamreplay.testing.synthetic import MOUNT_XYYAW, RANGE_MAX_M, synthetic_bundle
from slamreplay.testing.synthetic_rows import table_of, tf_rows

ROOM = synthetic_bundle(seconds=20.0)
SCANS = ROOM.table("scans")
#: Every beam comes back.
RANGES = np.minimum(SCANS["ranges_m"].values, np.float32(9.0))
SCANS = SCANS.replace(ranges_m=Ragged(RANGES, SCANS["ranges_m"].offsets))
BUNDLE = rebuilt(ROOM, {"scans": SCANS})


def perturbed(text: str, level: float, view=None, seed: int = 0):
    name, _, variant = text.partition(".")
    rng = np.random.Generator(np.random.PCG64(seed))
    return PERTURBATIONS.load(name)().apply(view or BUNDLE.view(), variant, level, rng)


def ranges_of(view):
    return view.table("scans")["ranges_m"].values


def with_scans(bundle: Bundle, rows, **columns) -> Bundle:
    """The bundle with other ranges, one list a scan, and other columns."""
    ragged = Ragged.of(rows, np.float32)
    return rebuilt(bundle, {"scans": bundle.table("scans").replace(ranges_m=ragged, **columns)})


def with_another_laser() -> Bundle:
    """Scans of a second topic, of another number of beams, between those of the first."""
    other = SCANS.replace(
        topic=np.full(len(SCANS), "/other", dtype=object),
        t_log_ns=SCANS["t_log_ns"] + 1,
        ranges_m=Ragged.of(np.full((len(SCANS), 7), 3.0), np.float32),
    )
    both = Table.concat(SCANS.schema, [SCANS, other])
    return rebuilt(BUNDLE, {"scans": both.take(np.argsort(both["t_log_ns"], kind="stable"))})


SCAN_LEVELS = [
    ("beam_drop.random", 0.3), ("beam_drop.field_of_view", 40.0), ("beam_drop.sector", 40.0),
    ("range_bias.offset", 0.2), ("range_bias.scale", 1.1), ("range_noise.gaussian", 0.1),
    ("range_noise.proportional", 0.05), ("max_range.share", 0.4), ("max_range.limit", 4.0),
    ("people.hidden", 0.2), ("clock_skew.laser", 0.01), ("stamp_jitter.scans", 0.01),
    ("scan_drop.nth", 0.25),
]  # fmt: skip


@pytest.mark.parametrize(("text", "level"), SCAN_LEVELS)
def test_another_laser_is_left_alone_and_the_first_fares_as_without_it(text, level):
    alone = perturbed(text, level)
    beside = perturbed(text, level, with_another_laser().view()).table("scans")

    own = beside["topic"] != "/other"
    assert fingerprints(beside.take(own)) == fingerprints(alone.table("scans"))
    other = with_another_laser().table("scans")
    other = other.take(other["topic"] == "/other")
    assert fingerprints(beside.take(~own)) == fingerprints(other)


def fingerprints(table):
    return [
        (table[c.name].values if isinstance(table[c.name], Ragged) else table[c.name])
        .tolist()
        .__repr__()
        for c in table.schema.columns
    ]


@pytest.mark.parametrize(("text", "level"), SCAN_LEVELS)
def test_a_log_without_scans_is_told_in_one_line(text, level):
    view = rebuilt(BUNDLE, {"scans": Table.empty(SCANS.schema)}).view()

    with pytest.raises(NotApplicableError, match="no scans"):
        perturbed(text, level, view)


@pytest.mark.parametrize(
    ("text", "low", "high"),
    [
        ("beam_drop.random", 0.2, 0.6),
        ("beam_drop.field_of_view", 20.0, 90.0),
        ("beam_drop.sector", 20.0, 90.0),
        ("max_range.share", 0.6, 0.3),
        ("max_range.limit", 6.0, 2.0),
    ],
)
def test_more_is_more_of_the_same(text, low, high):
    some, many = (np.isfinite(ranges_of(perturbed(text, level))) for level in (low, high))

    assert (many <= some).all()
    assert many.sum() < some.sum() < len(some)


@settings(max_examples=20, deadline=None)
@given(
    st.sampled_from(["range_noise.gaussian", "range_noise.proportional"]),
    st.floats(0.001, 0.02),
    st.floats(1.0, 2.0),
)
def test_more_noise_is_the_same_noise_magnified(text, level, times):
    some, more = (ranges_of(perturbed(text, x)) - RANGES for x in (level, level * times))

    np.testing.assert_allclose(more, some * times, atol=1e-5)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.0, 0.7), st.floats(0.0, 0.7))
def test_people_at_a_higher_level_are_the_same_people_and_more(a, b):
    few, many = (ranges_of(perturbed("people.hidden", x)) for x in sorted((a, b)))

    assert (many <= few).all()
    assert np.mean(many < RANGES) == pytest.approx(max(a, b), abs=1e-4)


def test_lost_beams_say_nothing_and_no_beam_is_lost_by_a_shorter_reach():
    lost = scan_set(perturbed("beam_drop.random", 0.4))
    short = scan_set(perturbed("max_range.limit", 3.0))

    assert not lost.misses.any()
    assert np.mean(lost.hits) == pytest.approx(0.6, abs=0.01)
    assert (short.hits | short.misses).all()
    np.testing.assert_array_equal(short.misses, RANGES.reshape(short.misses.shape) > 3.0)
    assert set(short.range_max_m) == {3.0}


def beams_left(view):
    """Bearings of the beams that are left in the first scan, in the laser's frame, deg."""
    scans = scan_set(view)
    return np.degrees(se2.wrap_angle(scans.bearings(0)[scans.hits[0]]))


def test_field_of_view_narrows_from_both_edges_and_a_sector_blocks_the_middle():
    narrow = beams_left(perturbed("beam_drop.field_of_view", 60.0))
    blocked = beams_left(perturbed("beam_drop.sector", 60.0))

    half = np.degrees(2.2)
    assert narrow.min() == pytest.approx(30.0 - half, abs=1.5)
    assert narrow.max() == pytest.approx(half - 30.0, abs=1.5)
    assert np.abs(blocked).min() == pytest.approx(30.0, abs=1.5)
    assert np.abs(blocked).max() == pytest.approx(half, abs=0.01)
    for text in ("beam_drop.field_of_view", "beam_drop.sector"):
        assert not len(beams_left(perturbed(text, 360.0)))


@pytest.mark.parametrize("first", [0.0, -np.pi, -np.pi / 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_all_around_the_field_of_view_is_narrowed_behind_wherever_the_first_beam_is(first, sign):
    view = with_scans(
        BUNDLE,
        np.full((len(SCANS), 360), 2.0),
        angle_min_rad=np.full(len(SCANS), first),
        angle_increment_rad=np.full(len(SCANS), sign * np.pi / 180),
    ).view()

    left = beams_left(perturbed("beam_drop.field_of_view", 90.0, view))

    assert np.abs(left).max() == pytest.approx(135.0, abs=1.01)
    assert 269 <= len(left) <= 271


CODES = {
    "inf": (np.inf, np.isposinf),
    "range_max": (RANGE_MAX_M, lambda r: r == 4.0),
    "nan": (np.nan, np.isnan),
    "zero": (0.0, np.isnan),
    "beyond": (81.9, np.isnan),
}


@pytest.mark.parametrize("code", CODES)
def test_a_return_beyond_the_reach_becomes_what_this_laser_tells_of_none(code):
    value, is_told = CODES[code]
    rows = RANGES.reshape(len(SCANS), -1).copy()
    rows[:, :20] = value
    view = with_scans(BUNDLE, rows).view()

    after = perturbed("max_range.limit", 4.0, view)

    there = ranges_of(after).reshape(rows.shape)
    beyond = (rows > 4.0) & (rows < RANGE_MAX_M)
    assert beyond[:, 20:].any()
    assert is_told(there[beyond]).all()
    np.testing.assert_array_equal(there[rows <= 4.0], rows[rows <= 4.0])
    before, scans = scan_set(view), scan_set(after)
    assert (
        scans.misses[:, :20].all() == before.misses[:, :20].all() == (code in ("inf", "range_max"))
    )
    near = (rows > 0) & (rows < 3.998)  # on the very range_max it is what none is told by
    assert (scans.hits[near]).all()
    assert scans.hits.sum() - near.sum() <= np.count_nonzero((rows >= 3.998) & (rows <= 4.0))


@pytest.mark.parametrize("level", [1000.0, RANGE_MAX_M, 20.0])
def test_a_reach_the_laser_does_not_have_changes_nothing(level):
    view = BUNDLE.view()

    assert perturbed("max_range.limit", level, view) is view


@pytest.mark.parametrize("code", CODES)
@pytest.mark.parametrize(
    ("text", "level"), [("range_bias.offset", -0.3), ("range_bias.scale", 0.1)]
)
def test_only_returns_are_biased(code, text, level):
    rows = RANGES.reshape(len(SCANS), -1).copy()
    rows[:, :20] = CODES[code][0]
    view = with_scans(BUNDLE, rows).view()

    after = ranges_of(perturbed(text, level, view)).reshape(rows.shape)

    np.testing.assert_array_equal(after[:, :20], rows[:, :20])
    wanted = rows[:, 20:] + level if text.endswith("offset") else rows[:, 20:] * level
    np.testing.assert_allclose(after[:, 20:], wanted, atol=1e-5)


def test_a_range_that_would_be_negative_is_lost():
    view = with_scans(BUNDLE, np.full((len(SCANS), 181), 0.2)).view()

    assert np.isnan(ranges_of(perturbed("range_bias.offset", -0.5, view))).all()


def test_range_noise_has_the_spread_it_says():
    absolute = ranges_of(perturbed("range_noise.gaussian", 0.1)) - RANGES
    relative = ranges_of(perturbed("range_noise.proportional", 0.02)) / RANGES - 1.0

    assert absolute.std() == pytest.approx(0.1, rel=0.02)
    assert absolute.mean() == pytest.approx(0.0, abs=0.003)
    assert relative.std() == pytest.approx(0.02, rel=0.02)


@pytest.mark.parametrize(("level", "n", "keeps"), [
    (0.5, 2, False), (0.333, 3, False), (0.25, 4, False), (1 / 49, 49, False), (0.667, 3, True),
    (0.9, 10, True), (0.4, 3, False), (0.999, 1000, True),
])  # fmt: skip
def test_every_nth_scan_is_lost_or_kept(level, n, keeps):
    left = perturbed("scan_drop.nth", level).table("scans").t_ns

    is_nth = (np.arange(len(SCANS)) + 1) % n == 0
    np.testing.assert_array_equal(left, SCANS.t_ns[is_nth if keeps else ~is_nth])


def test_skewed_clock_gains_from_its_first_stamp_on():
    late = perturbed("clock_skew.laser", 0.01).table("scans").t_ns - SCANS.t_ns

    since = SCANS.t_ns - SCANS.t_ns[0]
    np.testing.assert_allclose(late, 0.01 * since, atol=1.0)
    slow = perturbed("clock_skew.laser", -0.01).table("scans").t_ns - SCANS.t_ns
    np.testing.assert_allclose(slow, -late, atol=1.0)


@pytest.mark.parametrize(
    ("text", "level"), [("clock_skew.odometry", 0.01), ("stamp_jitter.odometry", 0.03)]
)
def test_odometry_of_topic_and_tf_share_a_clock(text, level):
    after = perturbed(text, level)

    before = BUNDLE.table("transforms")
    odom = (before["child_frame"] == "base_link") & (before["parent_frame"] == "odom")
    tf = after.table("transforms")
    assert not (tf.t_ns - before.t_ns)[~odom].any()
    np.testing.assert_array_equal(tf.t_ns[odom], after.table("odometry").t_ns)
    assert (after.table("odometry").t_ns != BUNDLE.table("odometry").t_ns).any()
    bare = rebuilt(BUNDLE, {"transforms": Table.empty(before.schema)}).view()
    moved = perturbed(text, level, bare).table("odometry").t_ns
    np.testing.assert_array_equal(moved, after.table("odometry").t_ns)
    none = rebuilt(bare.bundle, {"odometry": Table.empty(BUNDLE.table("odometry").schema)}).view()
    with pytest.raises(NotApplicableError, match="no odometry"):
        perturbed(text, level, none)


@settings(max_examples=30, deadline=None)
@given(st.floats(1e-4, 10.0), st.integers(0, 5), st.booleans())
def test_jittered_stamps_never_overtake_each_other(level, seed, is_shuffled):
    order = np.arange(len(SCANS))
    if is_shuffled:  # recorded in another order than they were stamped in
        order = order.reshape(-1, 2)[:, ::-1].ravel()
    view = rebuilt(BUNDLE, {"scans": SCANS.replace(t_ns=SCANS.t_ns[order])}).view()

    after = perturbed("stamp_jitter.scans", level, view, seed).table("scans").t_ns

    assert (np.diff(after[np.argsort(SCANS.t_ns[order])]) >= 0).all()


def test_jitter_has_the_spread_it_says_while_it_is_shorter_than_a_period():
    off = perturbed("stamp_jitter.scans", 0.01).table("scans").t_ns - SCANS.t_ns

    assert off.std() == pytest.approx(1e7, rel=0.15)
    np.testing.assert_allclose(
        perturbed("stamp_jitter.scans", 0.005).table("scans").t_ns - SCANS.t_ns, off / 2, atol=1.0
    )


def upside_down() -> Bundle:
    """The bundle with its laser turned about its x axis, and its beams in the other direction."""
    tf = BUNDLE.table("transforms")
    rotation = tf["rotation_xyzw"].copy()
    half = MOUNT_XYYAW[2] / 2
    rotation[tf["child_frame"] == "laser"] = [np.cos(half), np.sin(half), 0.0, 0.0]
    scans = SCANS.replace(
        angle_min_rad=-SCANS["angle_min_rad"], angle_increment_rad=-SCANS["angle_increment_rad"]
    )
    return rebuilt(BUNDLE, {"transforms": tf.replace(rotation_xyzw=rotation), "scans": scans})


def base_below_laser() -> Bundle:
    """The bundle with base -> laser written as laser -> base, on a base that hangs on nothing."""
    tf = BUNDLE.table("transforms")
    kept = tf.take((tf["child_frame"] != "laser") & (tf["child_frame"] != "base_link"))
    up = tf_rows("laser", "base_link", np.zeros(1), se2.inverse(MOUNT_XYYAW)[None], is_static=True)
    return rebuilt(BUNDLE, {"transforms": Table.concat(tf.schema, [kept, up])})


@pytest.mark.parametrize("bundle", [BUNDLE, upside_down(), base_below_laser()])
@pytest.mark.parametrize(
    ("variant", "level", "moved"),
    [("x", 0.1, [0.1, 0, 0]), ("y", -0.2, [0, -0.2, 0]), ("yaw", 10.0, [0, 0, np.radians(10.0)])],
)
def test_the_believed_mount_is_off_along_the_robots_axes(bundle, variant, level, moved):
    before = scan_set(bundle.view())

    after = scan_set(perturbed(f"laser_extrinsic.{variant}", level, bundle.view()))

    np.testing.assert_allclose(before.xyyaw_base_laser, MOUNT_XYYAW, atol=1e-9)
    np.testing.assert_allclose(after.xyyaw_base_laser, MOUNT_XYYAW + moved, atol=1e-9)
    np.testing.assert_array_equal(after.ranges_m, before.ranges_m)
    np.testing.assert_array_equal(after.angle_min, before.angle_min)


@pytest.mark.parametrize("frame", ["base_link", "nowhere"])
def test_a_laser_without_a_mount_gets_one(frame):
    names = np.full(len(SCANS), frame, dtype=object)
    view = rebuilt(BUNDLE, {"scans": SCANS.replace(frame_id=names)}).view()

    after = perturbed("laser_extrinsic.x", 0.3, view)

    np.testing.assert_allclose(scan_set(view).xyyaw_base_laser, 0.0)
    np.testing.assert_allclose(scan_set(after).xyyaw_base_laser, [0.3, 0.0, 0.0], atol=1e-12)


def disc_through(ends):
    """Middle and radius of the disc through points: least squares on x^2 + y^2 = 2ax + 2by + c."""
    A = np.column_stack([2 * ends, np.ones(len(ends))])
    a, b, c = np.linalg.lstsq(A, (ends**2).sum(axis=1), rcond=None)[0]
    return np.array([a, b]), np.sqrt(c + a * a + b * b)


def test_people_stand_where_their_beams_say_from_scan_to_scan():
    """One person alone: the ends of what they hide lie on a disc that moves at a walking pace."""
    scans = scan_set(perturbed("people.hidden", 0.004))
    hidden = scans.ranges_m != RANGES.reshape(scans.ranges_m.shape)
    rows = np.flatnonzero(hidden.sum(axis=1) >= 5)
    odometry = scans.odometry.at(scans.t_ns[rows]).xyyaw
    middles = []
    for k, pose in zip(rows, odometry, strict=True):
        bearing, reach = scans.bearings(k)[hidden[k]], scans.ranges_m[k][hidden[k]]
        ends = np.column_stack([reach * np.cos(bearing), reach * np.sin(bearing)])
        ends = se2.transform_points(se2.compose(pose, scans.xyyaw_base_laser), ends)
        middle, radius = disc_through(ends)
        assert radius == pytest.approx(0.22, abs=0.02)
        middles.append(middle)

    steps = np.hypot(*np.diff(middles, axis=0).T) / (np.diff(scans.t_ns[rows]) / 1e9)
    assert len(rows) >= 5
    assert 0.6 < np.median(steps) < 1.6
    assert np.ptp(steps) < 0.3


def spun(time_increment_s: float, *, hangs: bool = False) -> Bundle:
    """A robot that stands among nothing and turns, with a laser that sees all around."""
    t_s = np.arange(0.0, 20.0, 0.1)
    odometry_s = np.arange(0.0, 20.1, 0.05)
    poses = np.column_stack([0 * odometry_s, 0 * odometry_s, se2.wrap_angle(2.0 * odometry_s)])
    sign = -1.0 if hangs else 1.0
    mount = tf_rows("base_link", "laser", np.zeros(1), np.zeros((1, 3)), is_static=True)
    if hangs:
        mount = mount.replace(rotation_xyzw=[[1.0, 0.0, 0.0, 0.0]])
    scans = table_of(
        "scans", "/scan", t_s, frame_id="laser", angle_min_rad=-sign * 3.0,
        angle_increment_rad=sign * 2 * np.pi / 720, time_increment_s=time_increment_s,
        scan_time_s=0.1, range_min_m=0.05, range_max_m=30.0,
        ranges_m=list(np.full((len(t_s), 720), np.inf)),
    )  # fmt: skip
    tables = {
        "scans": scans,
        "transforms": Table.concat(
            mount.schema, [tf_rows("odom", "base_link", odometry_s, poses), mount]
        ),
    }
    return rebuilt(BUNDLE, tables)


@pytest.mark.parametrize("time_increment_s", [0.0, 0.1 / 720])
def test_people_are_the_same_to_a_laser_that_hangs_upside_down(time_increment_s):
    upright = perturbed("people.hidden", 0.1, spun(time_increment_s).view())
    turned = perturbed("people.hidden", 0.1, spun(time_increment_s, hangs=True).view())

    np.testing.assert_array_equal(np.isfinite(ranges_of(upright)).mean(), 0.1)
    np.testing.assert_allclose(ranges_of(upright), ranges_of(turned), atol=1e-5)


def middles_of_people(view):
    """By scan the middle, in the odometry frame, of the one who hides beams of it."""
    scans = scan_set(view)
    found = {}
    for k in np.flatnonzero(scans.hits.sum(axis=1) >= 8):
        ends = se2.transform_points(scans.odometry.at(scans.t_ns[[k]]).xyyaw[0], scans.points(k))
        found[int(k)], radius = disc_through(ends)
        assert radius == pytest.approx(0.22, abs=0.03)
    return found


def test_people_are_where_they_are_when_a_late_beam_meets_them():
    """A robot that turns by 0.2 rad while it scans: deskewed, its people are the same."""
    at_once = middles_of_people(perturbed("people.hidden", 0.003, spun(0.0).view()))
    late = middles_of_people(perturbed("people.hidden", 0.003, spun(0.1 / 720).view()))

    both = sorted(set(at_once) & set(late))
    assert len(both) >= 5
    for k in both:  # who walks on for 0.1 s at the most
        assert np.hypot(*(late[k] - at_once[k])) < 0.16


def test_somebody_at_the_seam_of_a_round_scan_is_met_on_both_sides_of_it():
    hidden = np.isfinite(ranges_of(perturbed("people.hidden", 0.02, spun(0.0).view())))
    hidden = hidden.reshape(-1, 720)

    wraps = hidden[:, 0] & hidden[:, -1]
    edges = np.count_nonzero(hidden != np.roll(hidden, 1, axis=1), axis=1)
    assert wraps.any()
    assert set(edges[(hidden[:, 0] | hidden[:, -1])]) <= {2, 4, 6}
    assert np.count_nonzero(hidden[:, 0] ^ hidden[:, -1]) <= 2 * np.count_nonzero(wraps)


def test_nobody_hides_what_is_nearer_than_they_are():
    near = with_scans(BUNDLE, np.full((len(SCANS), 181), 0.2)).view()

    with pytest.raises(NotApplicableError, match=r"people can hide 0\.0000 of the beams, not 0\.1"):
        perturbed("people.hidden", 0.1, near)


def test_people_need_odometry():
    tf = Table.empty(BUNDLE.table("transforms").schema)
    odometry = Table.empty(BUNDLE.table("odometry").schema)
    view = rebuilt(BUNDLE, {"transforms": tf, "odometry": odometry}).view()

    with pytest.raises(NotApplicableError, match="odometry"):
        perturbed("people.hidden", 0.1, view)
