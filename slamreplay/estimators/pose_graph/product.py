"""What a picture of the map and its graph is drawn from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.view import BundleView
from slamreplay.estimators.pose_graph.config import GraphConfig
from slamreplay.estimators.pose_graph.ledger import closures_ledger
from slamreplay.estimators.pose_graph.slam import slam_of
from slamreplay.geometry import se2


@dataclass(frozen=True, eq=False)
class MapAndGraph:
    """The map that SLAM made of a log, and the graph behind it.

    Attributes:
        frame_id: frame of all poses and points.
        node_xyyaw: (K, 3) the nodes, in the order in which they were driven.
        is_break: (K,) the motion to it is not known.
        points: (P, 2) where beams ended, m.
        closures: (E, 2) nodes that a closure was looked for between, the older one first.
        accepted: (E,) whether it counts in the end.
        score: (E,) how well the places fit, 0 to 1.
        passes: (M, 2) nodes of different passes that were laid onto each other.
    """

    frame_id: str
    node_xyyaw: se2.Array
    is_break: NDArray[np.bool_]
    points: se2.Array
    closures: NDArray[np.int64]
    accepted: NDArray[np.bool_]
    score: se2.Array
    passes: NDArray[np.int64]


def map_and_graph(view: BundleView, config: GraphConfig | None = None) -> MapAndGraph:
    """Build map and graph of a log, as `PoseGraph` does.

    Args:
        view: the log.
        config: hyper-parameters.

    Raises:
        NotApplicableError: no scans, or none with enough points.
    """
    slam = slam_of(view, config or GraphConfig(), "pose_graph", is_online=False)
    assert slam.smoothed is not None
    nodes, ledger = slam.smoothed.xyyaw, closures_ledger(slam)
    ends = [(c.old, c.new) for c in slam.closed.candidates]
    clouds = [
        se2.transform_points(pose, points)
        for pose, points in zip(nodes, slam.local.points, strict=True)
    ]
    return MapAndGraph(
        slam.start.frame_id,
        nodes,
        slam.local.is_break,
        np.concatenate(clouds),
        slam.maps.reference[np.array(ends, dtype=np.int64).reshape(-1, 2)],
        ledger.accepted,
        ledger.score,
        slam.smoothed.passes.pairs,
    )
