"""How old the pose was when it was used: named cases by hand, and a slow oracle."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from slamreplay.bundle.findings import FINDINGS
from slamreplay.bundle.manifest import Clock, Role
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import Bundle
from slamreplay.geometry import se2
from slamreplay.geometry.times import NO_STAMP, NS_PER_S, ns
from slamreplay.testing.synthetic import LATENCY_NS, START_NS, synthetic_bundle, true_path
from slamreplay.testing.synthetic_rows import table_of
from slamreplay.verdict.latency.ages import ages, motion_since
from slamreplay.verdict.latency.consumers import Consumer, moving_times
from slamreplay.verdict.latency.findings import late_findings
from slamreplay.verdict.latency.latency import latency, usages
from slamreplay.verdict.latency.spread import share_above, share_interval, spread
from slamreplay.verdict.latency.words import Words
from slamreplay.verdict.limits import Limits

MS = 1_000_000


def commands(hz=20.0, seconds=10.0, speed=0.5, late_s=0.005):
    """Unstamped twists: all that is known of them is when they were recorded."""
    t = np.arange(0.0, seconds, 1.0 / hz)
    table = table_of("commands", "/cmd_vel", t,
                     linear_velocity_xyz=np.tile([speed, 0.0, 0.0], (len(t), 1)),
                     angular_velocity_xyz=np.zeros((len(t), 3)))  # fmt: skip
    return table.replace(t_sensor_ns=np.full(len(t), NO_STAMP), t_log_ns=table.t_ns + ns(late_s))


def plans(hz=1.0, seconds=10.0, takes_s=0.06):
    t = np.arange(0.5, seconds, 1.0 / hz)
    ways = [np.zeros(6)] * len(t)
    table = table_of("plans", "/plan", t, frame_id="map", xyyaw=ways)
    return table.replace(t_log_ns=table.t_ns + ns(takes_s))


def driven(*, command=None, plan=None, seconds=10.0, edit=None, **options):
    """The synthetic log with somebody who uses its pose, every table put through `edit`."""
    bundle = synthetic_bundle(seconds=seconds, **options)
    given = {"commands": command, "plans": plan}
    tables = {n: t for n in TABLES if len(t := given.get(n) or bundle.table(n))}
    manifest = bundle.manifest
    roles = [Role(role=role, topic=str(t["topic"][0]), type="made", messages=len(t), reason="one")
             for role, t in (("command", command), ("plan", plan)) if t is not None]  # fmt: skip
    manifest = manifest.model_copy(update={"roles": [*manifest.roles, *roles]})
    if edit is not None:
        tables = {n: edit(t) for n, t in tables.items()}
    return Bundle(manifest, tables, bundle.grids())


def of(found, name):
    (one,) = [a for a in found.ages if a.consumer.name == name]
    return one


def seconds_of(found, name):
    return (of(found, name).consumer.t_ns - START_NS) / NS_PER_S


# --- named cases -----------------------------------------------------------------------------


def test_a_transform_dated_ahead_is_as_old_as_its_scan():
    found = latency(driven(command=commands()).view())
    controller = of(found, "controller")
    # Corrections speak of scans at 0, 0.5, 1 ... s, are there 5 ms later, dated 0.1 s ahead.
    used = seconds_of(found, "controller")
    expected = used - np.floor((used - 0.005 + 1e-9) / 0.5) * 0.5

    assert found.clocks.basis == "shared"
    assert (found.said.dated, found.said.lead_s) == ("scan", pytest.approx(0.1))
    np.testing.assert_allclose(controller.correction_s, expected, atol=1e-6)
    assert (controller.correction_s > 0.0).all()
    parts = controller.sensing_s + controller.answering_s + controller.waiting_s
    np.testing.assert_allclose(parts, controller.correction_s, atol=1e-9)
    np.testing.assert_allclose(controller.sensing_s, 0.005, atol=1e-9)


def test_odometry_carries_as_far_as_the_correction_is_dated_ahead():
    controller = of(latency(driven(command=commands()).view()), "controller")
    # tf answers for the last moment that both reach: odometry's, or 0.1 s after the scan.
    reach = controller.correction_s - 0.1

    np.testing.assert_allclose(
        controller.pose_s, np.maximum(controller.odometry_s, reach), atol=1e-9
    )
    assert (controller.pose_s > controller.odometry_s + 0.2).any()
    assert (controller.pose_s == controller.odometry_s).any()


def test_clocks_of_another_epoch_tell_ages_from_the_fastest_message_on():
    def elsewhere(table):
        return table.replace(t_log_ns=table["t_log_ns"] + 600_000 * NS_PER_S)

    bundle = driven(command=commands(), edit=elsewhere)
    # Log times are carried over by the delay of some stream, which need not be the least there is.
    knots = [(START_NS + 600_000 * NS_PER_S + LATENCY_NS - ns(0.015), START_NS)]
    clock = Clock(name="sensor", reason="header stamps", knots=knots)
    bundle = Bundle(bundle.manifest.model_copy(update={"clock": clock}),
                    {n: bundle.table(n) for n in TABLES}, bundle.grids())  # fmt: skip
    apart, shared = latency(bundle.view()), latency(driven(command=commands()).view())

    assert apart.clocks.basis == "relative"
    assert "the real ones are longer" in apart.clocks.caveats[0]
    # The fastest message took 5 ms, which nobody can know now.
    np.testing.assert_allclose(
        of(apart, "controller").correction_s + 0.005, of(shared, "controller").correction_s,
        atol=1e-6,
    )  # fmt: skip


def test_stamps_ahead_of_the_log_times_give_no_negative_age():
    def early(table):
        return table.replace(t_log_ns=table["t_log_ns"] - ns(0.02))

    found = latency(driven(command=commands(), edit=early).view())

    assert found.clocks.basis == "relative"
    assert "15 ms ahead of the log times" in found.clocks.caveats[0]
    for name in ("correction_s", "update_s", "pose_s", "odometry_s"):
        assert np.nanmin(getattr(of(found, "controller"), name)) >= 0.0, name


def test_one_stream_that_is_stamped_ahead_makes_the_others_no_older():
    def scans_late(table):
        if table.schema.name not in ("scans", "poses"):
            return table
        return table.replace(t_log_ns=table["t_log_ns"] - ns(0.22))

    plain, apart = (latency(driven(command=commands(), edit=e).view()) for e in (None, scans_late))

    assert apart.clocks.basis == "shared"
    assert "stamps of /scan lie 215 ms ahead" in apart.clocks.caveats[0]
    np.testing.assert_allclose(of(apart, "controller").odometry_s,
                               of(plain, "controller").odometry_s)  # fmt: skip
    # Corrections are of those scans: told on their clock they are 215 ms older.
    np.testing.assert_allclose(of(apart, "controller").correction_s,
                               of(plain, "controller").correction_s + 0.215, atol=1e-6)  # fmt: skip
    assert np.nanmin(of(apart, "controller").sensing_s) >= 0.0


def test_poses_without_tf_are_carried_by_odometry_as_the_belief_is():
    def no_tf(table):
        if table.schema.name != "transforms":
            return table
        return table.take(np.asarray(table["is_static"]))

    bundle = driven(command=commands(), edit=no_tf)
    frames = bundle.manifest.frames.model_copy(update={"tree": []})
    bundle = Bundle(bundle.manifest.model_copy(update={"frames": frames}),
                    {n: bundle.table(n) for n in TABLES}, bundle.grids())  # fmt: skip
    controller = of(latency(bundle.view()), "controller")

    np.testing.assert_array_equal(controller.pose_s, controller.odometry_s)
    assert np.nanmax(controller.correction_s) > 0.4


def test_log_times_that_are_the_stamps_tell_no_latency():
    def copied(table):
        stamps = table["t_sensor_ns"]
        return table.replace(t_log_ns=np.where(stamps == NO_STAMP, table["t_log_ns"], stamps))

    found = latency(driven(command=commands(), edit=copied).view())

    assert (found.clocks.basis, found.said.dated) == ("arrival", "arrival")
    assert "how long messages took is not told" in found.clocks.caveats[0]
    assert (of(found, "controller").sensing_s == 0.0).sum() == 0  # not known, not nought
    assert np.nanmax(of(found, "controller").waiting_s) <= 0.51


def test_a_log_without_stamps_counts_from_arrival():
    def bare(table):
        return table.replace(t_sensor_ns=np.full(len(table), NO_STAMP))

    found = latency(driven(command=commands(), edit=bare).view())

    assert found.clocks.basis == "arrival"
    assert "no header stamps" in found.clocks.caveats[0]


def test_without_plans_the_planner_is_asked_for_as_if_it_had_run():
    found = latency(driven(command=commands()).view())
    planner = of(found, "planner").consumer

    assert not planner.is_recorded
    assert planner.loop is None
    assert np.median(np.diff(planner.t_ns)) == pytest.approx(0.1 * NS_PER_S, rel=0.5)
    assert len(planner.t_ns) == pytest.approx(100, abs=5)


def test_a_plan_used_the_pose_when_it_was_begun():
    found = latency(driven(plan=plans()).view())
    planner = of(found, "planner")

    assert planner.consumer.topic == "/plan"
    assert planner.consumer.work_s == pytest.approx(0.06)
    np.testing.assert_allclose(seconds_of(found, "planner"), np.arange(0.5, 10.0), atol=1e-9)
    # The correction of 0.5 s is there at 0.505 s: too late for the plan of 0.5 s.
    np.testing.assert_allclose(planner.correction_s, 0.5, atol=1e-9)


def test_a_localizer_that_repeats_itself_has_no_newer_update():
    def frozen(table):
        if table.schema.name != "transforms":
            return table
        rows = np.flatnonzero((table["parent_frame"] == "map") & (table.t_ns > START_NS + ns(4.0)))
        out = {n: table[n].copy() for n in ("translation_xyz", "rotation_xyzw")}
        for column in out.values():
            column[rows] = column[rows[0]]
        return table.replace(**out)

    controller = of(latency(driven(command=commands(), edit=frozen).view()), "controller")

    assert np.nanmax(controller.correction_s) < 0.6
    assert np.nanmax(controller.update_s) == pytest.approx(5.955, abs=0.06)


def test_without_a_localizer_only_odometry_has_an_age():
    found = latency(driven(command=commands(), with_belief=False).view())
    controller = of(found, "controller")

    assert found.said is None
    assert np.isnan(controller.correction_s).all()
    np.testing.assert_array_equal(controller.pose_s, controller.odometry_s)


def test_a_map_that_is_fixed_to_odometry_is_never_late():
    def fixed(table):
        if table.schema.name != "transforms":
            return table
        up = table["parent_frame"] == "map"
        return table.replace(is_static=table["is_static"] | up)

    assert latency(driven(command=commands(), edit=fixed).view()).said is None


def test_neither_localizer_nor_odometry():
    bundle = synthetic_bundle(seconds=2.0, with_belief=False)
    kept = {"scans": bundle.table("scans")}
    roles = [r for r in bundle.manifest.roles if r.role == "scan"]
    frames = bundle.manifest.frames.model_copy(update={"odom": None, "base": None, "tree": []})
    manifest = bundle.manifest.model_copy(update={"roles": roles, "frames": frames})

    assert latency(Bundle(manifest, kept, {}).view()).ages == ()


def test_zeros_of_an_idle_controller_use_no_pose():
    idle = commands(speed=0.0)
    half = commands()
    half = half.replace(linear_velocity_xyz=np.where(
        (half.t_ns > START_NS + ns(5.0))[:, None], 0.0, half["linear_velocity_xyz"]
    ))  # fmt: skip

    assert [a.consumer.name for a in latency(driven(command=idle).view()).ages
            if a.consumer.is_recorded] == []  # fmt: skip
    assert seconds_of(latency(driven(command=half).view()), "controller").max() < 5.2


def test_a_loop_that_stalls_is_seen_and_keys_that_a_person_presses_are_no_loop():
    table = commands()
    gap = (table.t_ns > START_NS + ns(4.0)) & (table.t_ns < START_NS + ns(4.7))
    loop = of(latency(driven(command=table.take(~gap)).view()), "controller").consumer.loop
    rng = np.random.Generator(np.random.PCG64(1))
    keys = table.take(np.sort(rng.choice(len(table), 30, replace=False)))

    assert loop.period_s == pytest.approx(0.05)
    assert loop.stall_s == pytest.approx(0.7, abs=1e-6)
    assert loop.stall_ns - START_NS == pytest.approx(ns(4.005), abs=MS)
    assert of(latency(driven(command=keys).view()), "controller").consumer.loop is None


def test_the_unknown_motion_is_speed_times_age():
    bundle = driven(command=commands())
    found = latency(bundle.view())
    controller = of(found, "controller")
    motion = found.unknown_motion(controller)
    truth = se2.between(*(true_path((t - START_NS) / NS_PER_S)
                          for t in (controller.read_ns, controller.consumer.t_ns)))  # fmt: skip

    np.testing.assert_allclose(motion[:, 0], 0.5 * controller.pose_s, atol=0.02)
    np.testing.assert_allclose(motion[:, 2], truth[:, 2], atol=0.06)  # wheels have noise
    (usage,) = [u for u in usages(found) if u.ages is controller]
    assert usage.unknown_m.most == pytest.approx(0.5 * usage.pose.most, rel=0.1)
    assert usage.over[0] == pytest.approx(np.mean(controller.pose_s > 0.02))


def test_moving_times_leave_rests_out():
    bundle = synthetic_bundle(seconds=6.0)
    from slamreplay.bundle.odometry import odometry_track

    track = odometry_track(bundle.view())
    rest = np.minimum(np.arange(len(track)), 60)  # stands from 3 s on
    held = replace(track, xyyaw=track.xyyaw[rest], cov=track.cov[rest])
    at = (moving_times(held, 50.0) - START_NS) / NS_PER_S

    assert len(at) == pytest.approx(150, abs=25)
    assert at.max() < 3.5


# --- what is told of it ----------------------------------------------------------------------


def told(bundle, **limits):
    found = latency(bundle.view())
    return late_findings(found, usages(found), Limits(**limits))


def late_odometry(seconds):
    """Odometry that takes so long to arrive, on tf and on its topic."""

    def edit(table):
        slow = np.zeros(len(table), dtype=bool)
        if table.schema.name == "odometry":
            slow[:] = True
        elif table.schema.name == "transforms":
            slow = np.asarray(table["child_frame"] == "base_link")
        return table.replace(t_log_ns=table["t_log_ns"] + np.where(slow, ns(seconds), 0))

    return edit


def test_an_age_over_the_budget_alone_is_no_finding():
    bundle = driven(command=commands(hz=50.0), plan=plans())

    assert usages(latency(bundle.view()))[0].over[0] > 0.5
    assert told(bundle) == ()


@pytest.mark.parametrize(
    ("late_s", "plan", "severity"),
    [(0.7, plans(seconds=20.0), "info"), (1.3, plans(seconds=20.0), "warning"),
     (1.3, None, "info")],
)  # fmt: skip
def test_poses_that_were_old_while_the_robot_moved(late_s, plan, severity):
    bundle = driven(command=commands(hz=50.0, seconds=20.0), plan=plan, seconds=20.0,
                    edit=late_odometry(late_s))  # fmt: skip
    (finding,) = [f for f in told(bundle) if "the controller" in f.message]

    assert (finding.id, finding.severity) == ("SR-LAT-001", severity)
    assert finding.value == pytest.approx(late_s + 0.05, abs=0.02)
    assert (finding.high, finding.unit) == (0.02, "s")
    assert "which the pose did not say" in finding.message


def test_a_loop_that_stalled_while_the_robot_moved():
    table = commands(hz=50.0)
    gap = (table.t_ns > START_NS + ns(4.0)) & (table.t_ns < START_NS + ns(5.5))
    halted = commands(hz=50.0)
    halted = halted.replace(linear_velocity_xyz=np.where(
        (halted.t_ns > START_NS + ns(3.99))[:, None], 0.0, halted["linear_velocity_xyz"]
    ))  # fmt: skip
    stalled = told(driven(command=table.take(~gap), plan=plans()))

    assert [(f.id, f.severity) for f in stalled] == [("SR-LAT-002", "warning")]
    assert stalled[0].value == pytest.approx(1.5, abs=0.03)
    assert "moved 0.7" in stalled[0].message
    assert told(driven(command=halted.take(~gap), plan=plans())) == ()  # it had been told to stand
    assert [f.severity for f in told(driven(command=table.take(~gap)))] == ["info"]


def test_findings_are_explained_and_bound_to_the_limits():
    bundle = driven(command=commands(hz=50.0, seconds=20.0), plan=plans(seconds=20.0), seconds=20.0,
                    edit=late_odometry(1.3))  # fmt: skip

    assert [f.severity for f in told(bundle, position_m=2.0, yaw_rad=3.0)] == ["info"] * 2
    assert all(f.id in FINDINGS for f in told(bundle))


# --- the oracle ------------------------------------------------------------------------------

_WORD = st.tuples(st.integers(0, 3000), st.integers(0, 400), st.integers(0, 1500), st.booleans())


def words_of(rows, *, on_tf=True):
    """Arrival, latency and lead in ms, whether it is new; sorted by arrival."""
    rows = sorted(rows, key=lambda r: r[0])
    arrived, late, ahead = (np.array([r[k] for r in rows], dtype=np.int64) * MS for k in range(3))
    is_new = np.array([r[3] for r in rows], dtype=bool)
    if len(is_new):
        is_new[0] = True
    n = len(rows)
    return Words("x", arrived, arrived - late + ahead, arrived - late, np.full(n, NO_STAMP), is_new,
                 "stamp", 0.0, on_tf)  # fmt: skip


def consumer_at(times):
    return Consumer("controller", "/cmd_vel", np.sort(np.array(times, dtype=np.int64) * MS), 50.0)


@settings(max_examples=120, deadline=None)
@given(
    st.lists(_WORD, max_size=12),
    st.lists(_WORD, min_size=1, max_size=12),
    st.lists(st.integers(0, 4000), min_size=1, max_size=12),
)
def test_ages_are_what_a_loop_over_all_messages_finds(said, odometry, times):
    found = ages(consumer_at(times), words_of(said), words_of(odometry))
    words, wheels = words_of(said), words_of(odometry)

    for k, t in enumerate(found.consumer.t_ns.tolist()):
        there = [i for i in range(len(words)) if words.arrived_ns[i] <= t]
        carried = [int(wheels.measured_ns[i]) for i in range(len(wheels))
                   if wheels.arrived_ns[i] <= t]  # fmt: skip
        if not there:
            assert np.isnan([found.correction_s[k], found.pose_s[k], found.update_s[k]]).all()
            continue
        last = there[-1]
        new = [i for i in there if words.is_new[i]][-1]
        assert found.correction_s[k] == pytest.approx((t - words.measured_ns[last]) / NS_PER_S)
        assert found.update_s[k] == pytest.approx((t - words.measured_ns[new]) / NS_PER_S)
        assert found.waiting_s[k] == pytest.approx((t - words.arrived_ns[last]) / NS_PER_S)
        assert found.correction_s[k] >= found.waiting_s[k] >= 0.0
        if not carried:
            assert np.isnan(found.pose_s[k])
            continue
        read = min(max(carried), int(words.until_ns[last]))
        assert found.pose_s[k] == pytest.approx((t - read) / NS_PER_S)
        assert found.pose_s[k] >= found.odometry_s[k] >= 0.0


@settings(max_examples=120, deadline=None)
@given(st.lists(_WORD, min_size=1, max_size=15), st.integers(0, 900), st.integers(0, 900))
def test_a_stage_delays_and_never_hurries(said, one, other):
    short, long = sorted((one, other))
    words = words_of(said)
    slower, slowest = words.through(short * MS), words.through(long * MS)
    times = consumer_at(range(0, 6000, 37))
    plain, late = ages(times, words, None), ages(times, slower, None)

    assert (np.diff(slower.arrived_ns) >= short * MS).all() or short == 0
    assert len(slower) >= 1
    assert len(slowest) <= len(words)
    known = np.isfinite(late.correction_s)
    assert np.isfinite(plain.correction_s)[known].all()
    # The measurements may overtake each other; what has arrived cannot.
    assert (late.waiting_s[known] >= 0.0).all()
    assert slower.is_new.sum() <= words.is_new.sum()
    if short == 0:
        assert slower is words


def test_a_stage_longer_than_the_period_makes_answers_fewer():
    words = words_of([(100 * k, 20, 1000, True) for k in range(30)])

    assert len(words.through(80 * MS)) == 30
    assert np.diff(words.through(80 * MS).arrived_ns).max() == 100 * MS
    assert np.diff(words.through(250 * MS).arrived_ns).min() == 300 * MS
    assert len(words.through(250 * MS)) == 10


def test_motion_of_no_moment_is_unknown():
    since = np.array([NO_STAMP, 5])

    assert np.isnan(motion_since(None, since, np.array([7, 7]))).all()


# --- numbers ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("hits", "n"), [(0, 30), (3, 30), (15, 30), (30, 30)])
def test_shares_have_the_interval_of_clopper_and_pearson(hits, n):
    expected = stats.binomtest(hits, n).proportion_ci(0.95, method="exact")

    assert share_interval(hits / n, float(n)) == pytest.approx((expected.low, expected.high))


def test_percentiles_of_a_series_that_says_little_new_have_a_wide_interval_or_none():
    rng = np.random.Generator(np.random.PCG64(3))
    quick = rng.exponential(size=3000)
    slow = np.repeat(rng.exponential(size=60), 50)

    assert spread(quick).p95_low < 3.0 < spread(quick).p95_high  # -ln 0.05
    assert spread(quick).p95_high - spread(quick).p95_low < 0.6
    assert spread(slow).n_eff < 200 < spread(quick).n_eff
    assert spread([np.nan]).p95 is None
    assert spread([1.0, 2.0]).p95_low is None
    assert share_above([], 1.0) is None
    assert share_above([0.0, 2.0, np.nan, 0.0, 2.0], 1.0)[0] == 0.5


def test_the_interval_of_p95_covers_it_as_often_as_it_says():
    rng = np.random.Generator(np.random.PCG64(4))
    noise = rng.standard_normal((120, 1200))
    series = np.zeros_like(noise)
    for k in range(1, noise.shape[1]):
        series[:, k] = 0.7 * series[:, k - 1] + np.sqrt(1 - 0.49) * noise[:, k]
    told = [spread(x) for x in series]

    held = [s.p95_low <= 1.645 <= s.p95_high for s in told if s.p95_low is not None]
    assert len(held) > 100
    assert np.mean(held) > 0.88


def test_tables_of_a_bundle_are_read_as_they_are():
    """A view whose stamps were moved tells ages of nobody's log: stamps are not used then."""
    view = driven(command=commands()).view()
    table = view.table("transforms")
    moved = view.with_table(table.replace(t_ns=table.t_ns + ns(0.2)))

    assert latency(moved).said.dated == "arrival"
    assert isinstance(view.table("scans"), Table)
