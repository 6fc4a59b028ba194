"""Marginal covariances of every pose of a graph at once, and joint ones of chosen pairs."""

from __future__ import annotations

import gtsam
import numpy as np
from scipy.sparse import csc_matrix

from slamreplay.geometry import se2
from slamreplay.graph.sparse_inverse import Index, inverse_blocks

_NO_PAIRS = np.empty((0, 2), dtype=np.int64)


def marginal_covariances(
    graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, pairs: Index = _NO_PAIRS
) -> tuple[se2.Array, se2.Array]:
    """What `gtsam.Marginals` gives, for all poses in one pass over the factor.

    Args:
        graph: factors between poses of the plane only.
        values: poses (Pose2) under the keys 0 to N - 1, at the optimum.
        pairs: (M, 2) keys i, j, i != j, whose joint covariance is asked for.

    Returns:
        Marginal covariances (N, 3, 3), and covariances of the error of i with that of j (M, 3, 3);
        both in axes of the poses' own bodies, as gtsam's are.

    Raises:
        ValueError: a pose is held by nothing.
    """
    count = values.size()
    ordering = gtsam.Ordering.ColamdNonlinearFactorGraph(graph)
    order = np.array([ordering.at(k) for k in range(count)], dtype=np.int64)
    row, column, number = graph.linearize(values).sparseJacobian_()  # counts from 1; b comes last
    row, column = row.astype(np.int64) - 1, column.astype(np.int64) - 1
    A = csc_matrix((number, (row, column)), shape=(int(row.max()) + 1, 3 * count + 1))
    A = A[:, : 3 * count]
    H = (A.T @ A).tobsr((3, 3))
    i, j = np.repeat(np.arange(count), np.diff(H.indptr)), H.indices
    below = i > j
    tied = np.column_stack([i[below], j[below]]).astype(np.int64)
    return inverse_blocks(H.data[i == j], tied, H.data[below], order, pairs)
