"""Scan-matched odometry: who is believed where scan and odometry disagree."""

import numpy as np
import pytest

from slamreplay.geometry import se2
from slamreplay.hindsight.chain import MEMORY, POOR, Known, scan_matched


def wall(x0, y0, x1, y1):
    """Points on a wall, 5 cm apart."""
    n = max(int(np.hypot(x1 - x0, y1 - y0) / 0.05), 2)
    return np.linspace((x0, y0), (x1, y1), n)


ROOM = np.concatenate(
    [wall(0, 0, 6, 0), wall(6, 0, 6, 4), wall(6, 4, 2, 4), wall(2, 4, 2, 5), wall(2, 5, 0, 5),
     wall(0, 5, 0, 0)]
)  # fmt: skip
#: Another place that shares some of the walls' directions, and no more.
ELSEWHERE = np.concatenate(
    [wall(0, 0, 2.6, 0), wall(2.6, 0, 2.6, 1.5), wall(2.6, 1.5, 4.4, 1.5), wall(4.4, 1.5, 4.4, 4.7),
     wall(4.4, 4.7, 3.2, 6.1), wall(3.2, 6.1, 0, 6.1), wall(0, 6.1, 0, 0)]
)  # fmt: skip


def seen_from(points, pose):
    return se2.transform_points(se2.inverse(np.array(pose)), points)


def matched(scans, odometry):
    t_ns = np.arange(len(scans)) * 500_000_000
    return scan_matched(scans, odometry, t_ns, np.zeros(len(scans), dtype=bool))


WAY = [(1.5 + 0.25 * k, 2.0, 0.1 * k) for k in range(6)]


def test_a_poor_match_that_contradicts_odometry_is_a_break():
    scans = [*(seen_from(ROOM, p) for p in WAY), seen_from(ELSEWHERE, (1.6, 3.2, 0.5))]
    odometry = np.array([*WAY, (WAY[-1][0] + 0.02, *WAY[-1][1:])])  # the wheels saw nothing of it
    chain = matched(scans, odometry)

    assert chain.score[-1] > POOR  # something always fits somewhere
    assert chain.is_break.tolist() == [False] * 6 + [True]
    np.testing.assert_allclose(se2.between(chain.xyyaw[-2], chain.xyyaw[-1]), [0.02, 0, 0],
                               atol=0.01)  # fmt: skip


@pytest.mark.parametrize("slip", [(0.5, 0.0, 0.0), (0.0, 0.0, 0.3)])
def test_a_good_match_is_believed_against_odometry(slip):
    scans = [seen_from(ROOM, p) for p in WAY]
    odometry = np.array(WAY)
    odometry[3:] = se2.compose(odometry[2], se2.compose(np.array(slip),
                               se2.between(odometry[2], odometry[3:])))  # fmt: skip
    chain = matched(scans, odometry)

    assert not chain.is_break.any()
    assert chain.is_solid.tolist() == [True, True, True, False, True, True]
    truth = se2.between(np.array(WAY[0]), np.array(WAY))
    np.testing.assert_allclose(se2.between(chain.xyyaw[0], chain.xyyaw), truth, atol=0.05)


def test_matches_that_still_hold_are_not_made_again():
    way = [(1.5 + 0.05 * k, 2.0, 0.05 * k) for k in range(2 * MEMORY + 4)]
    odometry, t_ns = np.array(way), np.arange(len(way)) * 500_000_000
    scans = [seen_from(ROOM, p) for p in way]
    before = matched(scans, odometry)
    scans[3] = seen_from(ROOM, (*way[3][:2], way[3][2] + 0.1))
    is_same = np.arange(len(way)) != 3
    known = Known(before, is_same)

    again = scan_matched(scans, odometry, t_ns, np.zeros(len(way), dtype=bool), known)
    anew = matched(scans, odometry)

    assert np.flatnonzero(~known.still_holds()).tolist() == list(range(3, 4 + MEMORY))
    np.testing.assert_allclose(again.xyyaw[:3], before.xyyaw[:3], atol=1e-12)
    assert np.abs(again.xyyaw[3] - before.xyyaw[3])[2] > 0.05
    np.testing.assert_allclose(again.xyyaw, anew.xyyaw, atol=2e-3)
    scale = np.abs(anew.information).max()
    np.testing.assert_allclose(again.information, anew.information, atol=0.1 * scale)
