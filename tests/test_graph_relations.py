"""Relations between poses: solved at once and one after the other, and told from false ones."""

import gtsam
import numpy as np
import pytest

from slamreplay.geometry import se2
from slamreplay.graph.online import OnlineGraph
from slamreplay.graph.relations import Relations, relative_covariance, solved

SIGMAS = np.array([0.02, 0.01, 0.005])


def circle(rng, count=60, lap=40):
    """True poses on a circle, a drifting chain of motions, and true closures after a lap."""
    true = [np.zeros(3)]
    for _ in range(count - 1):
        true.append(se2.compose(true[-1], np.array([1.0, 0.1, 2.0 * np.pi / lap])))
    true = np.array(true)
    pairs = np.column_stack([np.arange(count - 1), np.arange(1, count)])
    chain = measured(true, pairs, rng)
    closures = measured(true, np.array([[k, k + lap] for k in range(0, count - lap, 4)]), rng)
    guess = [true[0]]
    for step in chain.xyyaw:
        guess.append(se2.compose(guess[-1], step))
    return true, np.array(guess), chain, closures


def measured(true, pairs, rng):
    noise = rng.normal(0.0, SIGMAS, (len(pairs), 3))
    seen = se2.between(true[pairs[:, 0]], true[pairs[:, 1]]) + noise
    return Relations(pairs, seen, np.tile(np.diag(SIGMAS**2), (len(pairs), 1, 1)))


def test_closures_take_the_drift_away_and_covariances_tell_how_far():
    nees = []
    for seed in range(8):
        true, guess, chain, closures = circle(np.random.default_rng(seed))
        found = solved(guess, np.zeros((3, 3)), chain, closures, phi=5.0, with_cov=True)
        off = found.xyyaw - true
        off[:, 2] = se2.wrap_angle(off[:, 2])
        nees.append(np.einsum("ni,nij,nj->n", off, np.linalg.inv(found.cov), off)[1:].mean())
        drift = np.hypot(*(guess - true)[-1, :2])
        assert np.hypot(*off[-1, :2]) < max(drift, 0.1)

    assert np.mean(nees) == pytest.approx(3.0, abs=1.0)


def test_a_false_closure_is_switched_off():
    true, guess, chain, closures = circle(np.random.default_rng(1))
    false = Relations(np.array([[5, 30]]), np.zeros((1, 3)), np.diag(SIGMAS**2)[None])
    both = Relations(
        np.concatenate([closures.pairs, false.pairs]),
        np.concatenate([closures.xyyaw, false.xyyaw]),
        np.concatenate([closures.cov, false.cov]),
    )

    found = solved(guess, np.zeros((3, 3)), chain, both, phi=5.0).xyyaw

    switches = both.switches(found, 5.0)
    assert switches[-1] < 0.01 < 0.5 < switches[:-1].min()
    assert np.hypot(*(found - true)[:, :2].T).max() < 0.3
    assert np.hypot(*(solved(guess, np.zeros((3, 3)), chain, both).xyyaw - true)[:, :2].T).max() > 1


def test_one_after_the_other_ends_where_all_at_once_does():
    _, guess, chain, closures = circle(np.random.default_rng(2))
    first_cov = np.diag([0.1, 0.2, 0.05]) ** 2
    online = OnlineGraph(guess[0], first_cov)
    for k in range(len(chain)):
        online.extend(chain.xyyaw[k], chain.cov[k])
        for e in np.flatnonzero(closures.pairs[:, 1] == k + 1):
            online.close(Relations(*(part[[e]] for part in parts(closures))))

    batch = solved(guess, first_cov, chain, closures, with_cov=True)

    assert online.poses == pytest.approx(batch.xyyaw, abs=1e-3)
    assert online.marginal(30) == pytest.approx(batch.cov[30], rel=0.02, abs=1e-6)


def test_a_relation_that_is_taken_out_again_leaves_no_trace():
    _, guess, chain, _ = circle(np.random.default_rng(3))
    online = OnlineGraph(guess[0], np.eye(3) * 1e-4)
    for k in range(20):
        online.extend(chain.xyyaw[k], chain.cov[k])
    before = online.poses
    false = Relations(np.array([[2, 19]]), np.zeros((1, 3)), np.eye(3)[None] * 1e-4)

    numbers = online.close(false)
    bent = online.poses
    online.undo(numbers)

    assert np.abs(bent - before).max() > 0.5
    assert online.poses == pytest.approx(before, abs=2e-3)


def test_loosened_motions_are_known_less_well():
    _, guess, chain, _ = circle(np.random.default_rng(5))
    plain, loosened = (OnlineGraph(guess[0], np.zeros((3, 3))) for _ in range(2))
    for graph in (plain, loosened):
        for k in range(20):
            graph.extend(chain.xyyaw[k], chain.cov[k])

    loosened.loosen(10, 20, 9.0)
    loosened.extend(chain.xyyaw[20], chain.cov[20])

    assert loosened.poses[:21] == pytest.approx(plain.poses, abs=1e-6)
    assert loosened.marginal(10) == pytest.approx(plain.marginal(10), rel=1e-6, abs=1e-9)
    ratio = loosened.relative(loosened.poses, 10, 20) / plain.relative(plain.poses, 10, 20)
    assert np.diag(ratio) == pytest.approx(9.0, rel=1e-3)


def test_the_relative_covariance_is_that_of_samples():
    rng = np.random.default_rng(4)
    i, j = np.array([1.0, -2.0, 0.7]), np.array([3.0, 1.5, -1.9])
    root = rng.normal(0.0, 0.01, (6, 6))
    joint = root @ root.T
    errors = rng.multivariate_normal(np.zeros(6), joint, 200_000)
    seen = se2.between(se2.compose(i, errors[:, :3]), se2.compose(j, errors[:, 3:]))

    cov = relative_covariance(i, j, joint[:3, :3], joint[3:, 3:], joint[:3, 3:])

    assert np.cov(seen.T) == pytest.approx(cov, rel=0.05, abs=2e-5)


def test_relations_are_measured_about_axes_of_the_first_pose():
    """A pose that is seen 10 m away is known badly across where the heading is."""
    cov = np.diag([0.01, 1.0, 0.01]) ** 2
    one = Relations(np.array([[0, 1]]), np.array([[10.0, 0.0, np.pi / 2]]), cov[None])

    found = solved(np.array([[0.0, 0, 0], [10, 0, np.pi / 2]]), np.zeros((3, 3)), one,
                   with_cov=True)  # fmt: skip

    assert found.cov[1] == pytest.approx(cov, abs=1e-5)
    assert gtsam.Pose2(*found.xyyaw[1]).equals(gtsam.Pose2(10, 0, np.pi / 2), 1e-9)


def parts(relations):
    return relations.pairs, relations.xyyaw, relations.cov
