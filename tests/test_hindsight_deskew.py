"""Sweeps that were taken while the robot moved and its wheels stood."""

import numpy as np

from slamreplay.hindsight.beams import HIT, Beams
from slamreplay.hindsight.chain import Chain
from slamreplay.hindsight.deskew import motion_as_matched

T_NS = np.arange(10) * 100_000_000
KEYS = np.array([0, 3, 6, 9])


def chained(x_m: list[float], *, is_break: tuple[bool, ...] = (False,) * 4) -> Chain:
    xyyaw = np.column_stack([x_m, np.zeros(4), np.zeros(4)])
    sure = np.ones(4, dtype=bool)
    return Chain(xyyaw, np.ones(4), np.array(is_break), sure, np.zeros((4, 3, 3)))


def matched(chain: Chain, sweep_s: float = 0.1):
    found = motion_as_matched("base", T_NS, np.zeros((10, 3)), KEYS, chain, sweep_s)
    return None if found is None else found.motion


def test_robot_moves_in_its_sweeps_as_its_scans_do_where_wheels_stand():
    track = matched(chained([0.0, 0.0, 0.6, 0.6]))

    assert track is not None
    np.testing.assert_allclose(track.xyyaw[:4], 0.0, atol=1e-12)
    np.testing.assert_allclose(track.xyyaw[3:7, 0], [0.0, 0.2, 0.4, 0.6], atol=1e-12)
    np.testing.assert_allclose(track.xyyaw[6:, 0], 0.6, atol=1e-12)


def test_odometry_that_misses_little_in_a_sweep_stays():
    assert matched(chained([0.0, 0.02, 0.0, 0.02])) is None


def test_scans_without_a_sweep_stay():
    assert matched(chained([0.0, 0.0, 0.6, 0.6]), sweep_s=0.0) is None


def test_motion_over_a_break_is_not_taken_from_the_scans():
    assert matched(chained([0.0, 0.0, 0.6, 0.6], is_break=(False, False, True, False))) is None


def test_sweeps_that_odometry_tells_rightly_stay_as_they_are():
    found = motion_as_matched(
        "base", T_NS, np.zeros((10, 3)), KEYS, chained([0.0, 0.0, 0.6, 0.6]), 0.1
    )
    kind = np.full((10, 1), HIT, dtype=np.int8)
    told = Beams(T_NS, np.zeros((10, 1, 2), dtype=np.float32), kind, np.zeros(2))
    again = Beams(T_NS, np.ones((10, 1, 2), dtype=np.float32), kind, np.zeros(2))

    # Scan 2 begins before the keyframe, and its sweep reaches into the motion that was missed.
    assert found.mended(told, again).ends[:, 0, 0].tolist() == [0, 0, 1, 1, 1, 1, 1, 0, 0, 0]
