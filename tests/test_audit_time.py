"""The time audit: each fault of a clock is found, its size told, and a sound log is left alone."""

from types import SimpleNamespace

import numpy as np
import pytest
from audited import edited, findings, healthy, on_edge, restamped, with_manifest
from hypothesis import given, settings
from hypothesis import strategies as st

from slamreplay.audit.delays import Jump, delays
from slamreplay.audit.leads import lead
from slamreplay.audit.log_audit import LogAudit, key
from slamreplay.audit.rates import odd_stamps, rate
from slamreplay.audit.streams import Stream
from slamreplay.bundle.manifest import Clock
from slamreplay.bundle.schema import TABLES, Column, TableSchema
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import Bundle
from slamreplay.consistency.audits.clock import _jumps as clock_jumps
from slamreplay.geometry.times import NO_STAMP, NS_PER_S
from slamreplay.testing.synthetic import START_NS

SECOND = NS_PER_S
EPOCH = 1_700_000_000 * SECOND


@pytest.fixture(scope="module")
def sound():
    return healthy()


def recorded(n=1200, hz=20.0, *, seed=0, noise_s=5e-4, stall_s=0.0):
    """Stamps, and log times that are later by a network's delay and one stall of the recorder."""
    rng = np.random.default_rng(seed)
    t = (np.arange(n) / hz * SECOND).astype(np.int64)
    late = rng.exponential(noise_s, n) + 0.002
    first = n // 3
    stalled = first + np.arange(int(stall_s * hz))
    late[stalled] += np.linspace(stall_s, 0.0, len(stalled))
    return EPOCH + t, np.maximum.accumulate(EPOCH + t + (late * SECOND).astype(np.int64))


# --- delays -----------------------------------------------------------------------------------


@given(
    offset_s=st.floats(-1e6, 1e6),
    ppm=st.floats(-20_000.0, 20_000.0),
    seed=st.integers(0, 9),
    stall_s=st.sampled_from([0.0, 2.0]),
)
@settings(max_examples=60, deadline=None)
def test_offset_and_drift_are_told(offset_s, ppm, seed, stall_s):
    stamps, log = recorded(seed=seed, stall_s=stall_s)
    drift = ((log - EPOCH) * ppm * 1e-6).astype(np.int64)
    found = delays(log + drift + int(offset_s * SECOND), stamps)
    made = 1e-6 * ppm * 60.0

    assert found.median_s == pytest.approx(offset_s + made / 2, abs=0.05 + 0.02 * abs(made))
    assert found.jumps == ()
    if abs(ppm) > 200.0:
        assert found.drift_ppm == pytest.approx(ppm, rel=0.05, abs=60.0)
        assert found.drift_s == pytest.approx(made, rel=0.05, abs=0.004)
    elif abs(ppm) < 5.0:
        assert found.drift_ppm is None


@given(
    size_s=st.floats(0.05, 30.0),
    sign=st.sampled_from([-1.0, 1.0]),
    at=st.integers(150, 700),
    ppm=st.sampled_from([0.0, 80.0, -5000.0]),
    seed=st.integers(0, 5),
)
@settings(max_examples=80, deadline=None)
def test_a_jump_is_found_where_and_as_large_as_it_was(size_s, sign, at, ppm, seed):
    stamps, log = recorded(seed=seed)
    log = log + ((log - EPOCH) * ppm * 1e-6).astype(np.int64)
    stamps[at:] += int(sign * size_s * SECOND)
    found = delays(log, stamps)

    (jump,) = found.jumps
    assert jump.t_log_ns == log[at]
    assert jump.seconds == pytest.approx(sign * size_s, rel=0.1, abs=0.01)
    if abs(ppm) > 1000.0:  # the jump is no drift
        assert found.drift_ppm == pytest.approx(ppm, rel=0.1)


@given(stall_s=st.floats(0.2, 10.0), seed=st.integers(0, 5), hz=st.sampled_from([5.0, 20.0, 100.0]))
@settings(max_examples=40, deadline=None)
def test_a_recorder_that_stalls_is_no_jump_of_a_clock(stall_s, seed, hz):
    stamps, log = recorded(n=int(60 * hz), hz=hz, seed=seed, stall_s=stall_s)

    assert delays(log, stamps).jumps == ()


def test_stamps_ahead_of_the_log_time():
    stamps, log = recorded()
    found = delays(log, stamps + SECOND // 100 + 2 * SECOND // 1000)
    some = stamps.copy()
    some[::100] += SECOND // 10

    assert found.lead_s == pytest.approx(0.01, abs=0.002)
    assert delays(log, stamps).lead_s is None
    assert delays(log, stamps).ahead == 0
    assert delays(log, some).ahead == 12


def test_nothing_is_told_of_nothing():
    assert delays(np.zeros(0, np.int64), np.zeros(0, np.int64)) is None
    assert delays(np.full(3, EPOCH), np.full(3, NO_STAMP)) is None
    one = delays(np.array([EPOCH + SECOND]), np.array([EPOCH]))
    assert (one.median_s, one.drift_ppm, one.jumps) == (1.0, None, ())
    same = delays(np.full(50, EPOCH), EPOCH + np.arange(50) * SECOND)  # a recorder without a clock
    assert (same.drift_ppm, same.jumps) == (None, ())


# --- rates ------------------------------------------------------------------------------------


@given(
    hz=st.sampled_from([5.0, 10.0, 50.0, 200.0]),
    gap_s=st.floats(1.2, 8.0),
    at=st.floats(0.2, 0.8),
    jitter=st.floats(0.0, 0.1),
)
@settings(max_examples=50, deadline=None)
def test_a_gap_is_told_by_the_streams_own_rate(hz, gap_s, at, jitter):
    rng = np.random.default_rng(1)
    n = int(60 * hz)
    t = np.sort(((np.arange(n) + jitter * rng.uniform(-1, 1, n)) / hz * SECOND).astype(np.int64))
    whole = rate(t, 0, 60 * SECOND)
    first = int(at * n)
    cut = np.delete(t, np.arange(first, first + int(gap_s * hz)))
    found = rate(cut, 0, 60 * SECOND)

    assert whole.is_regular
    assert whole.gaps == ()
    assert whole.missing == 0
    assert whole.period_s == pytest.approx(1.0 / hz, rel=0.02)
    (gap,) = found.gaps
    assert gap.start_ns == t[first - 1]
    assert gap.seconds == pytest.approx(gap_s, abs=2.5 / hz)
    assert found.missing == pytest.approx(int(gap_s * hz), abs=1 + 0.02 * gap_s * hz)


def test_single_messages_that_are_missing_are_counted():
    t = np.arange(600) * SECOND // 10
    found = rate(np.delete(t, np.arange(5, 600, 50)), 0, 60 * SECOND)

    assert found.missing == 12
    assert found.gaps == ()


def test_what_comes_when_it_comes_has_no_gaps():
    t = np.cumsum(np.random.default_rng(0).exponential(1.0, 200) * SECOND).astype(np.int64)

    assert not rate(t, 0, int(t[-1])).is_regular
    assert rate(t, 0, int(t[-1])).gaps == ()
    assert rate(t[:1], 0, SECOND).period_s is None


def test_odd_stamps_are_counted():
    t = np.arange(100) * SECOND
    t[10] = NO_STAMP
    t[20] = t[19]
    t[30] = t[29] - 3 * SECOND
    found = odd_stamps(t)

    assert (found.zero, found.repeated, found.backwards, found.back_s) == (1, 1, 1, 3.0)


# --- leads ------------------------------------------------------------------------------------


def stream(stamps, log, edge=("map", "odom")):
    rows = np.arange(len(stamps))
    return Stream("/tf", "transforms", edge, is_static=False, rows=rows, t_ns=stamps,
                  t_sensor_ns=np.asarray(stamps), t_log_ns=np.asarray(log))  # fmt: skip


CLOCK = Clock(name="sensor", reason="test", knots=[(EPOCH, EPOCH)])


@given(
    tolerance_s=st.floats(0.05, 8.0),
    wobble=st.floats(0.001, 0.04),
    busy_s=st.floats(0.001, 0.3),
    seed=st.integers(0, 5),
)
@settings(max_examples=60, deadline=None)
def test_transform_tolerance_is_told_to_the_millisecond(tolerance_s, wobble, busy_s, seed):
    rng = np.random.default_rng(seed)
    n = 400
    scans = EPOCH + np.cumsum((0.1 + wobble * rng.uniform(-1, 1, n)) * SECOND).astype(np.int64)
    arrived = scans + 60_000_000 + rng.integers(0, 2_000_000, n)
    answered = arrived + int(busy_s * SECOND) + rng.integers(0, 4_000_000, n)
    found = lead(stream(scans + int(tolerance_s * SECOND), answered), CLOCK, stream(scans, arrived))

    assert found.over == "scan"
    assert found.seconds == pytest.approx(tolerance_s, abs=0.002)
    assert found.share > 0.95


def test_a_lead_over_ones_own_clock_is_told_too():
    rng = np.random.default_rng(0)
    sent = EPOCH + np.arange(400) * SECOND // 20
    scans = EPOCH + np.cumsum(rng.uniform(0.07, 0.13, 200) * SECOND).astype(np.int64)
    found = lead(stream(sent + SECOND // 20, sent + rng.integers(0, 300_000, 400)), CLOCK,
                 stream(scans, scans + 5_000_000))  # fmt: skip

    assert found.over == "log time"
    assert found.seconds == pytest.approx(0.05, abs=0.001)
    assert lead(stream(sent, sent + 1_000_000), CLOCK, None) is None
    wild = sent + rng.integers(0, SECOND, 400)
    assert lead(stream(wild, sent), CLOCK, None) is None


# --- what is said of a log --------------------------------------------------------------------


def every(bundle, name):
    return np.arange(len(bundle.table(name)))


def test_a_sound_log_has_no_warning_and_its_tolerance_is_no_fault(sound):
    (told,) = findings(sound)

    assert told[:2] == ("SR-CLK-007", "info")
    assert "map -> odom is dated 0.100 s ahead of the scan it was made from" in told[2]
    assert "no fault of a clock" in told[2]


def later(seconds):
    return lambda t: t + int(seconds * SECOND)


def unstamped(t):
    return np.full_like(t, NO_STAMP)


FAULTS = {
    "jump": (
        lambda b: restamped(b, "scans", every(b, "scans")[200:], later(2.0)),
        ("SR-CLK-003", "warning", "stamps of /scan went ahead by 2.000 s"),
    ),
    "small jump": (
        lambda b: restamped(b, "scans", every(b, "scans")[200:], later(-0.06)),
        ("SR-CLK-003", "info", "stamps of /scan fell back by 0.060 s"),
    ),
    "skew": (
        lambda b: edited(b, "scans", every(b, "scans"), t_sensor_ns=later(-20.0)),
        ("SR-CLK-004", "warning", "/scan -19.99"),
    ),
    "small skew": (
        lambda b: restamped(b, "scans", every(b, "scans"), later(-2.0)),
        ("SR-CLK-004", "warning", "/scan -1.99"),
    ),
    "tf of another clock": (
        lambda b: edited(b, "transforms", on_edge(b, "map", "odom"), t_sensor_ns=later(7e5)),
        ("SR-CLK-004", "warning", "/tf map -> odom +700000"),
    ),
    "zero": (
        lambda b: edited(b, "scans", every(b, "scans")[:60], t_sensor_ns=unstamped),
        ("SR-CLK-005", "warning", "messages without a stamp: /scan 60 of 400"),
    ),
    "backwards": (
        lambda b: restamped(b, "scans", [50], later(-0.5)),
        ("SR-CLK-005", "warning", "stamps that go back: /scan 1 of 400, by up to 0.400 s"),
    ),
    "repeated": (
        lambda b: restamped(b, "odometry", [50, 60], later(-0.05)),
        ("SR-CLK-005", "info", "stamps that repeat the one before: /odom 2 of 801"),
    ),
    "future": (
        lambda b: restamped(b, "scans", every(b, "scans"), later(0.2)),
        ("SR-CLK-005", "warning", "stamps later than the log time: /scan all 400, by 0.19"),
    ),
    "a little ahead": (
        lambda b: restamped(b, "scans", every(b, "scans"), later(0.02)),
        ("SR-CLK-005", "info", "stamps later than the log time: /scan all 400, by 0.01"),
    ),
    "odometry on tf ahead": (
        lambda b: restamped(b, "transforms", on_edge(b, "odom", "base_link"), later(0.4)),
        ("SR-CLK-005", "warning", "/tf odom -> base_link all 801, by 0.39"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_of_a_clock_is_found(sound, fault):
    spoil, (id_, severity, words) = FAULTS[fault]
    found = [f for f in findings(spoil(sound), "clock", "stamps") if f[0] == id_]

    (told,) = found
    assert told[1] == severity
    assert words in told[2]


def without_rows(bundle, name, rows):
    from slamreplay.testing.edits import rebuilt

    table = bundle.table(name)
    return rebuilt(bundle, {name: table.take(np.setdiff1d(np.arange(len(table)), rows))})


@pytest.mark.parametrize(
    ("rows", "severity", "words"),
    [
        (np.arange(100, 130), "warning", "a gap of 3.10 s at 9.9 s; 30 of 400 messages missing"),
        (np.arange(100, 106), "info", "a gap of 0.70 s at 9.9 s; 6 of 400 messages missing"),
        (np.arange(3, 400, 7), "warning", "57 of 400 messages missing"),
        (np.arange(3, 400, 30), "info", "14 of 400 messages missing"),
        (np.arange(0, 60), "info", "begins 6.0 s after the log"),
        (np.arange(330, 400), "info", "ends 7.1 s before the log"),
    ],
)
def test_gaps_of_a_sensor_are_found(sound, rows, severity, words):
    (found,) = findings(without_rows(sound, "scans", rows), "stamps")[:1]

    assert found[:2] == ("SR-CLK-006", severity)
    assert words in found[2]


@given(ppm=st.floats(-1e5, 1e5).filter(lambda p: abs(p) > 5000.0))
@settings(max_examples=15, deadline=None)
def test_clocks_of_different_speed_are_told(ppm):
    bundle = healthy(seconds=40.0)
    drift = lambda log: log + ((log - START_NS) * ppm * 1e-6).astype(np.int64)  # noqa: E731
    for name in ("scans", "odometry", "transforms", "poses"):
        bundle = edited(bundle, name, every(bundle, name), t_log_ns=drift)
    log = np.array([k[0] for k in bundle.manifest.clock.knots])
    knots = list(zip(drift(log).tolist(), [k[1] for k in bundle.manifest.clock.knots], strict=True))
    bundle = with_manifest(bundle, clock=Clock(name="sensor", reason="test", knots=knots))

    (found,) = findings(bundle, "clock")
    assert found[:2] == ("SR-CLK-001", "warning")
    assert "different speeds" in found[2]
    told = float(found[2].split("(")[1].split(" ppm")[0])
    assert told == pytest.approx(ppm / (1.0 + 1e-6 * ppm), rel=0.05)


def in_simulated_time(bundle, pace=0.8):
    """Stamps that count from 50 s while the log goes on in wall time, at another pace."""

    def simulated(t):
        return ((t - START_NS) * pace).astype(np.int64) + 50 * SECOND

    for name in ("scans", "odometry", "transforms", "poses"):
        rows = every(bundle, name)
        bundle = edited(bundle, name, rows, t_sensor_ns=simulated, t_ns=simulated)
    knots = [(log, int(simulated(np.int64(t)))) for log, t in bundle.manifest.clock.knots]
    clock = Clock(name="sensor", reason="test", knots=knots)
    return with_manifest(bundle, clock=clock, start_ns=50 * SECOND, end_ns=int(82 * SECOND))


def test_simulated_time_is_told_with_its_pace_and_is_no_warning(sound):
    (told, *others) = findings(in_simulated_time(sound), "clock", "stamps")

    assert told[:2] == ("SR-CLK-001", "info")
    assert "simulated time, at 0.8000 of the log's pace" in told[2]
    assert {f[0] for f in others} <= {"SR-CLK-007"}


@pytest.mark.parametrize("follows", [True, False])
def test_what_a_clock_topic_says_is_used_where_there_is_one(sound, monkeypatch, follows):
    times = TABLES["commands"].columns[:4]
    schema = TableSchema("clock", "simulated time", (*times, Column("clock_ns", "int64")))
    monkeypatch.setitem(TABLES, "clock", schema)
    simulated = in_simulated_time(sound)
    log = START_NS + np.arange(400) * SECOND // 10
    said = simulated.manifest.clock.from_log_time(log) + (0 if follows else 500 * SECOND)
    table = Table(schema, {"t_ns": said, "t_sensor_ns": np.full(400, NO_STAMP), "t_log_ns": log,
                           "topic": ["/clock"] * 400, "clock_ns": said})  # fmt: skip
    tables = {name: simulated.table(name) for name in TABLES if name != "clock"}
    bundle = Bundle(simulated.manifest, {**tables, "clock": table}, {})

    from slamreplay.consistency.audits.inspection import inspect

    message = findings(bundle, "clock")[0][2]
    assert ("as /clock says" in message) == follows
    told = inspect(bundle)["clock"]["simulated"]
    assert (told["topic"], told["messages"]) == ("/clock", 400)
    assert told["pace"] == pytest.approx(0.8, abs=0.01)


def test_without_a_clock_topic_nothing_is_said_of_one(sound):
    from slamreplay.consistency.audits.inspection import inspect

    assert inspect(sound)["clock"]["simulated"] is None


def test_latched_maps_and_fixed_transforms_of_the_day_before_are_no_fault(sound):
    day = 86_400 * SECOND
    fixed = on_edge(sound, "base_link", "laser")
    old = edited(sound, "transforms", fixed, t_sensor_ns=lambda t: t - day)
    old = edited(old, "initial_poses", [0], t_sensor_ns=lambda t: t - day)

    assert findings(old) == findings(sound)


def test_streams_of_tf_are_edges_and_a_topic_may_fill_two_tables(sound):
    audit = LogAudit(sound.view())
    names = [key(s) for s in audit.streams]

    assert len(names) == len(set(names))
    assert "/tf odom -> base_link (transforms)" in names
    assert all((np.diff(s.t_log_ns) >= 0).all() for s in audit.streams)
    assert not any(s.table == "references" for s in audit.streams)  # they only judge


def test_a_clock_that_jumps_all_the_time_is_one_finding():
    times = np.array([EPOCH])
    laser = Stream("/scan", "scans", None, is_static=False, rows=np.arange(1), t_ns=times,
                   t_sensor_ns=times, t_log_ns=times)  # fmt: skip
    for count, findings_told in ((4, 4), (40, 1)):
        told = [Jump(EPOCH + k * 10 * SECOND, 0.3 + k / 100, 0.1) for k in range(count)]
        late = SimpleNamespace(jumps=tuple(told))
        audit = SimpleNamespace(sensors=[laser], delays={key(laser): late})
        found = clock_jumps(audit, CLOCK)
        assert len(found) == findings_told
    assert "/scan jumped 40 times against the log time, by up to 0.690 s" in found[0].message
    assert (found[0].start_ns, found[0].end_ns) == (EPOCH, EPOCH + 390 * SECOND)
