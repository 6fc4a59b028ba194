"""Pose graphs: closed forms for a straight chain, and anchors that lie."""

import numpy as np

from slamreplay.geometry import se2
from slamreplay.graph.planar import smooth_chain

STEP = np.array([1.0, 0.0, 0.0])


def chain(heading: float, count: int) -> np.ndarray:
    poses = [np.array([2.0, -1.0, heading])]
    for _ in range(count - 1):
        poses.append(se2.compose(poses[-1], STEP))
    return np.array(poses)


def smooth(truth, anchor_rows, anchors, *, is_open=None, step_sigma=(0.05, 0.01, 1e-4)):
    n = len(truth) - 1
    return smooth_chain(
        truth + np.array([0.1, -0.05, 0.02]),
        np.tile(STEP, (n, 1)),
        np.tile(np.diag(np.square(step_sigma)), (n, 1, 1)),
        np.zeros(n, dtype=bool) if is_open is None else is_open,
        np.ones(n, dtype=bool),
        np.array(anchor_rows),
        anchors,
        np.tile(np.diag([0.02**2, 0.02**2, 0.001**2]), (len(anchors), 1, 1)),
    )


def test_variance_grows_along_the_way_in_the_axes_of_the_map():
    heading = 0.6
    truth = chain(heading, 5)
    poses, cov = smooth(truth, [0], truth[:1])

    np.testing.assert_allclose(poses, truth, atol=1e-4)
    ahead = np.array([np.cos(heading), np.sin(heading)])
    across = np.array([-ahead[1], ahead[0]])
    along = [ahead @ c[:2, :2] @ ahead for c in cov]
    # 0.02 m of the anchor and 0.05 m for each step; the loose prior takes off one part in 10 000.
    np.testing.assert_allclose(along, [0.02**2 + k * 0.05**2 for k in range(5)], rtol=2e-3)
    assert across @ cov[4, :2, :2] @ across < 0.3 * along[4]


def test_one_wrong_anchor_among_many_is_outvoted():
    truth = chain(0.3, 9)
    anchors = truth.copy()
    anchors[4, :2] += [0.0, 0.6]
    poses, _ = smooth(truth, range(9), anchors)

    assert np.hypot(*(poses - truth)[:, :2].T).max() < 0.03


def test_open_link_lets_the_sides_lie_apart():
    truth = chain(0.0, 6)
    truth[3:, 0] += 20.0
    is_open = np.arange(5) == 2
    poses, _ = smooth(truth, range(6), truth, is_open=is_open)

    assert np.hypot(*(poses - truth)[:, :2].T).max() < 0.01


def test_same_graph_gives_the_same_bytes():
    truth = chain(0.3, 9)

    assert (
        smooth(truth, range(9), truth)[1].tobytes() == smooth(truth, range(9), truth)[1].tobytes()
    )
