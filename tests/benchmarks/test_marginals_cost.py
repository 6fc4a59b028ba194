"""Covariances of all poses of a large graph against gtsam's own, in one run.

Run with: uv run pytest tests/benchmarks/test_marginals_cost.py --benchmark-only -s
"""

import time

import gtsam
import numpy as np

from slamreplay.graph.marginals import marginal_covariances

GOAL, RUNS = 8.0, 3


def manhattan():
    """gtsam's example of 10 000 poses and 64 311 measurements, solved."""
    graph, values = gtsam.load2D(gtsam.findExampleDataFile("w10000.graph"))
    sigmas = gtsam.noiseModel.Diagonal.Sigmas(np.full(3, 0.01))
    graph.add(gtsam.PriorFactorPose2(0, values.atPose2(0), sigmas))
    return graph, gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()


def test_marginals_of_ten_thousand_poses(benchmark):
    graph, values = manhattan()
    marginal_covariances(graph, values)  # compiled here, or loaded from the cache
    ours, theirs = [], []
    for _ in range(RUNS):
        before = time.process_time()
        found, _ = marginal_covariances(graph, values)
        ours.append(time.process_time() - before)
        before = time.process_time()
        marginals = gtsam.Marginals(graph, values)
        expected = np.array([marginals.marginalCovariance(k) for k in range(len(found))])
        theirs.append(time.process_time() - before)
    ratio = float(np.median(theirs) / np.median(ours))
    error = np.abs(found - expected).max(axis=(1, 2)) / np.abs(expected).max(axis=(1, 2))
    print(f"\n{np.median(ours):.2f} s of CPU time against {np.median(theirs):.2f} s: {ratio:.1f}x;")
    print(f"largest relative error of a pose {error.max():.1e}")
    benchmark.extra_info |= {"times_faster": ratio, "goal": GOAL, "error": float(error.max())}
    benchmark.pedantic(lambda: marginal_covariances(graph, values), rounds=1)
    assert error.max() < 1e-6
