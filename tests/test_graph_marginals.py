"""Covariances by the sparse inverse: those of gtsam, and of the dense inverse."""

import gtsam
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slamreplay.graph.marginals import marginal_covariances
from slamreplay.graph.sparse_inverse import inverse_blocks


def loop(count, closures, rng):
    """A noisy chain of poses with closures between them, solved."""
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    prior = gtsam.noiseModel.Diagonal.Sigmas(np.array([0.1, 0.2, 0.05]))
    graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(), prior))
    pose = gtsam.Pose2()
    for k in range(count):
        values.insert(k, pose)
        pose = pose.compose(gtsam.Pose2(1.0, 0.1, 2.0 * np.pi / 20.0))
    pairs = [(k, k + 1) for k in range(count - 1)] + list(closures)
    for i, j in pairs:
        root = rng.normal(0.0, 0.1, (3, 3))
        noise = gtsam.noiseModel.Gaussian.Covariance(root @ root.T + 0.01 * np.eye(3))
        seen = values.atPose2(i).between(values.atPose2(j))
        seen = seen.compose(gtsam.Pose2(*rng.normal(0.0, 0.02, 3)))
        graph.add(gtsam.BetweenFactorPose2(i, j, seen, noise))
    return graph, gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()


def relative_error(found, expected):
    return np.abs(found - expected).max() / np.abs(expected).max()


def test_marginals_are_those_of_gtsam_joint_ones_too():
    rng = np.random.default_rng(3)
    graph, values = loop(60, [(0, 20), (5, 45), (59, 19), (30, 50)], rng)
    pairs = np.array([[3, 4], [20, 0], [7, 52], [52, 8]])  # some are tied by no factor

    marginals, joint = marginal_covariances(graph, values, pairs)

    by_gtsam = gtsam.Marginals(graph, values)
    expected = np.array([by_gtsam.marginalCovariance(k) for k in range(60)])
    assert relative_error(marginals, expected) < 1e-9
    for (i, j), block in zip(pairs.tolist(), joint, strict=True):
        both = by_gtsam.jointMarginalCovariance(gtsam.KeyVector([i, j]))
        assert relative_error(block, both.at(i, j)) < 1e-9


def test_a_robust_closure_that_is_given_up_holds_nothing():
    rng = np.random.default_rng(4)
    graph, values = loop(12, [], rng)
    alone, _ = marginal_covariances(graph, values)
    noise = gtsam.noiseModel.Robust.Create(
        gtsam.noiseModel.mEstimator.DCS.Create(1.0), gtsam.noiseModel.Isotropic.Sigma(3, 0.01)
    )
    graph.add(gtsam.BetweenFactorPose2(0, 11, gtsam.Pose2(900.0, 0.0, 0.0), noise))

    with_it, _ = marginal_covariances(graph, values)

    assert with_it == pytest.approx(alone, rel=1e-3)


@settings(max_examples=40, deadline=None)
@given(
    count=st.integers(1, 9),
    seed=st.integers(0, 2**16),
    density=st.floats(0.0, 1.0),
    some_are_zero=st.booleans(),
)
def test_blocks_of_the_inverse_are_those_of_the_dense_one(count, seed, density, some_are_zero):
    rng = np.random.default_rng(seed)
    i, j = np.tril_indices(count, -1)
    tied = rng.random(len(i)) < density
    pairs = np.column_stack([i, j])
    swap = rng.random(len(pairs)) < 0.5
    pairs[swap] = pairs[swap, ::-1]
    blocks = rng.normal(0.0, 1.0, (len(pairs), 3, 3)) * tied[:, None, None]
    H = np.zeros((count, 3, count, 3))
    for (a, b), block in zip(pairs, blocks, strict=True):
        H[a, :, b], H[b, :, a] = block, block.T
    H[range(count), :, range(count)] = np.eye(3) * (3.0 * count + 1.0)
    listed = pairs[tied | some_are_zero], blocks[tied | some_are_zero]

    diagonal, off = inverse_blocks(
        H[range(count), :, range(count)].copy(), *listed, rng.permutation(count), pairs
    )

    expected = np.linalg.inv(H.reshape(3 * count, 3 * count)).reshape(count, 3, count, 3)
    assert diagonal == pytest.approx(expected[range(count), :, range(count)], abs=1e-12)
    for (a, b), block in zip(pairs, off, strict=True):
        assert block == pytest.approx(expected[a, :, b], abs=1e-12)


def test_a_matrix_that_is_not_definite_is_refused():
    H = np.eye(3)[None] * np.array([1.0, -1.0])[:, None, None]
    nothing = np.empty((0, 2), dtype=np.int64)

    with pytest.raises(ValueError, match="not positive definite"):
        inverse_blocks(H, nothing, np.empty((0, 3, 3)), np.arange(2), nothing)
