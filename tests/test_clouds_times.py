"""What drivers write as the time of a point, and when it is not believed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slamreplay.geometry.times import NO_STAMP
from slamreplay.ingest.clouds.fields import Clouds
from slamreplay.ingest.clouds.point_times import PointTimes, meaning_of

START_S, COLUMNS = 1_750_000_000, 40
LATE = np.linspace(0.0, 0.099, COLUMNS)  # of a sweep at 10 Hz


def sweeps(time, *, count=5, stamp=True, period_s=0.1):
    """Clouds whose points have `time(stamp in s, seconds after it)`."""
    stamps_s = START_S + period_s * np.arange(count)
    t_ns = np.rint(stamps_s * 1e9).astype(np.int64)
    recorded = np.concatenate([np.broadcast_to(time(s, LATE), COLUMNS) for s in stamps_s])
    return Clouds(
        xyz=np.ones((3, count * COLUMNS), dtype=np.float32),
        time=recorded.astype(np.float64),
        offsets=np.arange(count + 1) * COLUMNS,
        rows=np.ones(count, dtype=np.int64),
        frame_id=np.full(count, "lidar", dtype=object),
        t_sensor_ns=t_ns if stamp else np.full(count, NO_STAMP),
        t_log_ns=t_ns + 105_000_000,
        index=np.arange(count),
    )


DRIVERS = {
    "velodyne, first packet": (lambda _stamp, late: np.float32(late), "s", "stamp", 0.0),
    "velodyne, last packet": (lambda _stamp, late: np.float32(late - 0.099), "s", "stamp", -0.099),
    "ouster": (lambda _stamp, late: np.uint32(late * 1e9), "ns", "stamp", 0.0),
    "hesai and robosense": (lambda stamp, late: stamp + late, "s", "epoch", 0.0),
    "hesai, stamped last": (lambda stamp, late: stamp - 0.099 + late, "s", "epoch", -0.099),
    "livox": (lambda stamp, late: stamp * 1e9 + late * 1e9, "ns", "epoch", 0.0),
    "lidar on another clock": (lambda stamp, late: stamp + 37.0 + late, "s", "first", 0.0),
    "lidar since it was started": (
        lambda stamp, late: stamp - START_S + 900 + late,
        "s",
        "first",
        0,
    ),
    "microseconds": (lambda _stamp, late: np.uint32(late * 1e6), "us", "stamp", 0.0),
}


@pytest.mark.parametrize("name", DRIVERS)
def test_times_of_each_driver_are_seconds_after_the_stamp(name):
    time, unit, origin, first_s = DRIVERS[name]
    clouds = sweeps(time)

    meaning = meaning_of(clouds, 0.1)
    late_s, sound = meaning.after_stamp_s(clouds)

    assert (meaning.unit, meaning.origin) == (unit, origin)
    assert sound.all()
    np.testing.assert_allclose(late_s.reshape(-1, COLUMNS) - first_s, [LATE] * 5, atol=2e-6)


@given(st.sampled_from([0.02, 0.05, 0.1, 0.2, 1.0]), st.floats(0.05, 1.2),
       st.sampled_from(["s", "ms", "us", "ns"]))  # fmt: skip
def test_the_unit_is_the_one_in_which_a_sweep_fits_the_rate(period_s, part, unit):
    per_s = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}[unit]
    clouds = sweeps(lambda _stamp, late: late / LATE[-1] * part * period_s * per_s,
                    period_s=period_s)  # fmt: skip

    assert meaning_of(clouds, period_s).unit == unit


@pytest.mark.parametrize(
    ("time", "words"),
    [
        (lambda _stamp, _late: 0.0, "the same time"),
        (lambda stamp, _late: np.float32(stamp), "the same time"),
        (lambda _stamp, late: 5.0 * late, "no sweep of clouds 0.1 s apart"),
        (lambda _stamp, late: np.nan * late, "no time"),
    ],
)
def test_times_that_cannot_be_a_sweep_are_refused(time, words):
    assert words in meaning_of(sweeps(time), 0.1)


def test_one_cloud_with_odd_times_is_left_alone():
    clouds = sweeps(lambda _stamp, late: late)
    clouds.time[COLUMNS : 2 * COLUMNS] = 7e5 * np.arange(COLUMNS)

    late_s, sound = meaning_of(clouds, 0.1).after_stamp_s(clouds)

    assert sound.tolist() == [True, False, True, True, True]
    assert np.isnan(late_s.reshape(-1, COLUMNS)).all(axis=1).tolist() == (~sound).tolist()


def test_points_without_return_and_time_have_no_time():
    clouds = sweeps(lambda _stamp, late: late + 0.01)
    clouds.xyz[:, 3] = np.nan
    clouds.time[3] = 0.0

    late_s, _ = meaning_of(clouds, 0.1).after_stamp_s(clouds)

    assert np.flatnonzero(np.isnan(late_s)).tolist() == [3]


def test_dates_need_a_stamp():
    clouds = sweeps(lambda stamp, late: stamp + late, stamp=False)

    assert meaning_of(clouds, 0.1).origin == "first"
    assert not PointTimes("s", "epoch", 0.1).after_stamp_s(clouds)[1].any()
