"""Which laser plays scan_2: another one, on tf, still and level, that is not the first again."""

import numpy as np
import pytest

from slamreplay.bundle.manifest import Frames
from slamreplay.bundle.no_return import told_as_range_max
from slamreplay.bundle.tables import Ragged
from slamreplay.ingest.lasers import no_returns, second_scan
from slamreplay.ingest.roles import choose_scan
from slamreplay.ingest.rows import TopicRows
from slamreplay.ingest.valid_beams import valid_beams

SCANS = 12
FRAMES = Frames(map=None, odom="odom", base="base_link", tree=[])
#: Front laser ahead, rear laser behind and turned round, both see 240 deg.
FRONT, REAR = (0.3, 0.1, 0.0), (-0.3, -0.1, np.pi)
BEARINGS = np.linspace(-np.radians(120), np.radians(120), 241)


def room(pose, bearings):
    """Ranges from a pose to the walls of a room of 8 x 6 m about the base."""
    x, y, yaw = pose
    c, s = np.cos(yaw + bearings), np.sin(yaw + bearings)
    with np.errstate(divide="ignore"):
        walls = [(4.0 - x) / c, (-4.0 - x) / c, (3.0 - y) / s, (-3.0 - y) / s]
    return np.min([np.where(w > 0, w, np.inf) for w in walls], axis=0)


def scans(topic, frame, bearings, ranges, late_ns=0):
    """Rows of a laser with these ranges (SCANS, B) over bearings (B,)."""
    n, width = ranges.shape
    lengths = np.arange(n + 1) * width
    t = np.arange(n) * 10**8 + late_ns
    columns = {
        "frame_id": np.full(n, frame, dtype=object),
        "angle_min_rad": np.full(n, bearings[0]),
        "angle_increment_rad": np.full(n, bearings[1] - bearings[0]),
        "range_min_m": np.full(n, 0.1),
        "range_max_m": np.full(n, 20.0),
        "ranges_m": Ragged(ranges.astype(np.float32).ravel(), lengths),
    }
    return TopicRows(topic, "sensor_msgs/msg/LaserScan", n, "scans", columns, t, t)


def noisy(pose, seed):
    rng = np.random.Generator(np.random.PCG64(seed))
    return room(pose, BEARINGS) + rng.normal(0.0, 0.01, (SCANS, len(BEARINGS)))


def tf(**mounts):
    """Rows of static edges base_link -> frame; a mount is x, y, yaw and a pitch."""
    names, xyz, xyzw = [], [], []
    for frame, (x, y, yaw, *pitch) in mounts.items():
        p = pitch[0] / 2 if pitch else 0.0
        names.append(frame)
        xyz.append([x, y, 0.2])
        half = yaw / 2
        xyzw.append([-np.sin(half) * np.sin(p), np.cos(half) * np.sin(p),
                     np.sin(half) * np.cos(p), np.cos(half) * np.cos(p)])  # fmt: skip
    n = len(names)
    columns = {
        "parent_frame": np.full(n, "base_link", dtype=object),
        "child_frame": np.array(names, dtype=object),
        "is_static": np.ones(n, dtype=bool),
        "translation_xyz": np.array(xyz),
        "rotation_xyzw": np.array(xyzw),
    }
    t = np.zeros(n, dtype=np.int64)
    return TopicRows("/tf_static", "tf2_msgs/msg/TFMessage", n, "transforms", columns, t, t)


def front(**kwargs):
    return scans("/front", "laser_front", BEARINGS, noisy(FRONT, 1), **kwargs)


def rear(frame="laser_rear"):
    return scans("/rear", frame, BEARINGS, noisy(REAR, 2), late_ns=20_000_000)


def merged(step_deg):
    """Both lasers about base_link, the nearer end of a beam in each bin of its bearing."""
    step = np.radians(step_deg)
    bearings = np.arange(-np.pi, np.pi - step / 2, step)
    out = np.full((SCANS, len(bearings)), np.inf)
    for pose, seed in ((FRONT, 1), (REAR, 2)):
        ranges = noisy(pose, seed)
        x = pose[0] + ranges * np.cos(pose[2] + BEARINGS)
        y = pose[1] + ranges * np.sin(pose[2] + BEARINGS)
        reach = np.hypot(x, y)
        bins = np.rint((np.arctan2(y, x) + np.pi) / step).astype(int) % len(bearings)
        for row in range(SCANS):
            np.minimum.at(out[row], bins[row], reach[row])
    return scans("/scan_merged_all", "base_link", bearings, out)


def chosen(topics, *mounts):
    first, second = second_scan(topics, choose_scan(topics), mounts, FRAMES)
    return first, second and second.rows.topic


MOUNTS = tf(laser_front=FRONT, laser_rear=REAR)


def test_the_other_laser_is_found_whatever_the_order():
    for topics in ([front(), rear()], [rear(), front()]):
        first, second = chosen(topics, MOUNTS)
        assert {first.rows.topic, second} == {"/front", "/rear"}


def test_filtered_copies_are_no_second_laser():
    same_frame = scans("/scan_filtered_a", "laser_front", BEARINGS, noisy(FRONT, 1))
    moved = noisy(FRONT, 1)
    moved[:, ::9] = np.inf
    other_frame = scans("/scan_filtered_b", "laser_copy", BEARINGS, moved)
    mounts = tf(laser_front=FRONT, laser_copy=FRONT)

    first, second = chosen([front(), same_frame, other_frame], mounts)

    assert second is None
    assert first.reason.count("in the frame of") == 1
    assert first.reason.count("holds its beams already") == 1


def test_a_merge_that_is_densest_stands_alone():
    first, second = chosen([front(), rear(), merged(0.5)], MOUNTS)

    assert (first.rows.topic, second) == ("/scan_merged_all", None)
    assert first.reason.count("holds its beams already") == 2


def test_a_coarse_merge_is_dropped_for_its_parts():
    first, second = chosen([front(), rear(), merged(2.0)], MOUNTS)

    assert {first.rows.topic, second} == {"/front", "/rear"}
    assert "/scan_merged_all" in first.reason


@pytest.mark.parametrize(
    ("mounts", "why"),
    [
        (tf(laser_front=FRONT), "laser_rear is not on tf"),
        (tf(laser_front=FRONT, laser_rear=(*REAR, 0.4)), "does not look along the map's plane"),
    ],
)
def test_a_laser_of_unknown_place_or_tilted_is_named_and_left(mounts, why):
    first, second = chosen([front(), rear()], mounts)

    assert second is None
    assert why in first.reason


def test_a_laser_that_tilts_is_left():
    steps = [tf(laser_front=FRONT, laser_rear=(*REAR, pitch)) for pitch in (0.0, 0.05)]
    for i, rows in enumerate(steps):
        rows.columns["is_static"][:] = False
        rows.t_sensor_ns[:] = i * 10**8
        rows.t_log_ns[:] = i * 10**8
    first, second = chosen([front(), rear()], *steps)

    assert second is None
    assert "moves on the robot" in first.reason


def test_range_max_that_stands_for_no_return_is_counted_and_no_valid_beam():
    ranges = noisy(FRONT, 0)
    ranges[:, ::3] = 20.0
    told = scans("/scan", "front", BEARINGS, ranges)
    plain = scans("/scan", "front", BEARINGS, noisy(FRONT, 0))

    (loss,) = no_returns([told, plain])

    assert (loss.what, loss.count) == ("/scan", 12 * 81)
    assert valid_beams(told) == 12 * 160
    assert valid_beams(plain) == 12 * 241


def test_returns_that_happen_to_reach_range_max_are_returns():
    rng = np.random.Generator(np.random.PCG64(1))
    ranges = rng.uniform(0.5, 20.2, (200, 360)).astype(np.float32)

    assert not told_as_range_max(ranges, np.full((200, 1), 20.0)).any()
    ranges[rng.random(ranges.shape) < 0.05] = 20.0
    assert told_as_range_max(ranges, np.full((200, 1), 20.0)).mean() == pytest.approx(
        0.05, abs=0.01
    )
