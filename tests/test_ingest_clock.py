"""Which clock drives the replay, and where rows land whose stamps are another one's."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slamreplay.geometry.times import NO_STAMP
from slamreplay.ingest.clock import choose_clock
from slamreplay.ingest.row_times import row_times
from slamreplay.ingest.rows import TopicRows

SECOND = 10**9
EPOCH = 1_700_000_000 * SECOND
TYPES = {
    "scans": "sensor_msgs/msg/LaserScan",
    "odometry": "nav_msgs/msg/Odometry",
    "imu": "sensor_msgs/msg/Imu",
    "poses": "geometry_msgs/msg/PoseWithCovarianceStamped",
    "transforms": "tf2_msgs/msg/TFMessage",
    "commands": "geometry_msgs/msg/Twist",
}


def topic(table, hz, *, seconds=60.0, late_s=0.005, off_s=0.0, name=None, log_from=EPOCH):
    """A topic that is recorded `late_s` after its stamps, which lie `off_s` off the log's clock."""
    true = np.rint(np.arange(0.0, seconds, 1.0 / hz) * SECOND).astype(np.int64) + log_from
    late = np.broadcast_to(np.asarray(late_s) * SECOND, true.shape).astype(np.int64)
    off = np.broadcast_to(np.asarray(off_s) * SECOND, true.shape).astype(np.int64)
    return of(table, true + off, true + late, name)


def of(table, stamps, logged, name=None, **columns):
    n = len(stamps)
    if table == "transforms":
        columns = {"parent_frame": np.full(n, "odom", object),
                   "child_frame": np.full(n, "base", object)} | columns  # fmt: skip
    return TopicRows(name or f"/{table}", TYPES[table], n, table, columns, np.asarray(stamps),
                     np.asarray(logged))  # fmt: skip


def placed(rows, clock):
    times, losses = row_times(rows, clock)
    return times, [(loss.count, loss.reason) for loss in losses]


def test_kinds_of_evidence_outvote_messages():
    # The IMU alone has more messages than all the others, and runs on a clock of its own.
    sane = [topic("scans", 10), topic("odometry", 20)]
    imu = topic("imu", 200, off_s=500.0)
    clock = choose_clock([*sane, imu])

    for rows in sane:
        assert np.array_equal(placed(rows, clock)[0], rows.t_sensor_ns)
    times, losses = placed(imu, clock)
    assert np.abs(times - imu.t_log_ns).max() < SECOND // 20
    assert losses == [(len(imu), "stamped by another clock (+500 s), placed by log time")]
    assert "/imu: +500 s off" in clock.reason


def test_a_localizer_on_another_computer_does_not_outvote_the_sensors():
    sensors = [topic("scans", 10, off_s=-7e5), topic("odometry", 20, off_s=-7e5)]
    others = [topic("poses", 10), topic("transforms", 50)]
    clock = choose_clock([*sensors, *others])

    assert np.array_equal(placed(sensors[0], clock)[0], sensors[0].t_sensor_ns)


def test_simulated_and_wall_stamps_in_one_log():
    # tf and scans on simulated time, odometry on the wall's: two kinds against one.
    simulated = [topic("scans", 10, off_s=-EPOCH / SECOND), topic("imu", 50, off_s=-EPOCH / SECOND)]
    wall = topic("odometry", 20)
    clock = choose_clock([*simulated, wall])
    times, losses = placed(wall, clock)

    assert "simulated time" in clock.reason
    assert np.abs(times - (wall.t_sensor_ns - EPOCH)).max() < SECOND // 20
    assert [count for count, _ in losses] == [len(wall)]


@given(off_s=st.floats(6.0, 59.0), sign=st.sampled_from([-1.0, 1.0]))
@settings(max_examples=30, deadline=None)
def test_a_constant_skew_below_a_minute_is_another_clock_too(off_s, sign):
    sane = [topic("odometry", 20), topic("imu", 50)]
    scans = topic("scans", 10, off_s=sign * off_s)
    clock = choose_clock([*sane, scans])
    times, losses = placed(scans, clock)

    assert np.abs(times - (scans.t_sensor_ns - sign * off_s * SECOND)).max() < SECOND // 20
    assert [count for count, _ in losses] == [len(scans)]
    assert "another clock" in losses[0][1]


@given(late_s=st.floats(0.0, 2.0))
@settings(max_examples=20, deadline=None)
def test_a_latency_is_no_skew(late_s):
    scans = topic("scans", 10, late_s=late_s)
    clock = choose_clock([topic("odometry", 20), topic("imu", 50), scans])
    times, losses = placed(scans, clock)

    assert np.array_equal(times, scans.t_sensor_ns)
    assert losses == []


def test_only_the_stretch_on_another_clock_is_placed_by_log_time():
    scans = topic("scans", 10)
    stamps = scans.t_sensor_ns.copy()
    stamps[300:] += 20 * SECOND  # its computer's clock was set in the middle
    scans = of("scans", stamps, scans.t_log_ns)
    clock = choose_clock([topic("odometry", 20), topic("imu", 50), scans])
    times, losses = placed(scans, clock)

    assert np.array_equal(times[:300], stamps[:300])
    assert np.abs(times[310:] - (stamps[310:] - 20 * SECOND)).max() < SECOND // 20
    assert 290 <= losses[0][0] <= 300


def test_transforms_dated_ahead_stay_where_they_are_dated():
    ahead = topic("transforms", 20, off_s=5.0)
    foreign = topic("transforms", 20, off_s=30.0)
    clock = choose_clock([topic("scans", 10), topic("odometry", 20), ahead])

    assert placed(ahead, clock)[1] == []
    assert [count for count, _ in placed(foreign, clock)[1]] == [len(foreign)]


def test_a_message_that_was_kept_back_is_not_said_to_have_another_clock():
    poses = topic("poses", 2)
    stamps = poses.t_sensor_ns.copy()
    stamps[0] -= 300 * SECOND
    poses = of("poses", stamps, poses.t_log_ns)
    clock = choose_clock([topic("scans", 10), poses])

    assert placed(poses, clock)[1] == [
        (1, "stamped 300 s before it was recorded (kept back), placed by log time")
    ]


def test_a_recorder_that_stalls_does_not_bend_the_clock():
    late = np.full(600, 0.005)
    late[300:330] += np.linspace(3.0, 0.0, 30)  # three seconds of scans were written at once
    scans = topic("scans", 10, late_s=late)
    command = of("commands", np.full(1, NO_STAMP), [EPOCH + 31 * SECOND])
    clock = choose_clock([scans])

    (t_ns,), losses = placed(command, clock)
    assert abs(t_ns - (EPOCH + 31 * SECOND)) < 0.2 * SECOND
    assert losses == []


@given(pace=st.floats(0.4, 1.6), jump_s=st.sampled_from([0.0, 4.0, -4.0]))
@settings(max_examples=30, deadline=None)
def test_log_times_are_carried_over_at_any_pace_and_past_a_pause(pace, jump_s):
    log = EPOCH + np.arange(600, dtype=np.int64) * (SECOND // 10)
    stamps = (100 * SECOND + (log - EPOCH) * pace).astype(np.int64)
    if pace * 60.0 > 20.0:
        stamps[300:] += int(max(jump_s, 0.0) * SECOND)  # it may skip, and never goes back
    clock = choose_clock([of("scans", stamps, log)])

    error = clock.from_log_time(log[5:-5]) - stamps[5:-5]
    near = np.abs(np.arange(5, 595) - 300) > 15
    assert np.abs(error[near]).max() < 0.02 * SECOND


def test_a_stream_that_is_dated_ahead_does_not_carry_the_log_times():
    ahead = topic("imu", 100, off_s=0.8)
    clock = choose_clock([topic("scans", 10, late_s=0.08), topic("odometry", 50), ahead])

    assert "/odometry" in clock.reason
    assert abs(int(clock.from_log_time([EPOCH + SECOND])[0]) - EPOCH - SECOND) < SECOND // 20


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_zero_stamps_are_placed_by_log_time(share):
    scans = topic("scans", 10)
    stamps = scans.t_sensor_ns.copy()
    zero = np.arange(len(stamps)) < share * len(stamps)
    stamps[zero] = NO_STAMP
    scans = of("scans", stamps, scans.t_log_ns)
    times, losses = placed(scans, choose_clock([scans, topic("odometry", 20)]))

    assert np.abs(times - scans.t_log_ns).max() < SECOND // 20
    assert sum(count for count, _ in losses) == int(zero.sum())
