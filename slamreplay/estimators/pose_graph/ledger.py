"""The residual ledger of loop closures: each place found, against where it was expected."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.run import Innovations
from slamreplay.estimators.pose_graph.slam import Slam
from slamreplay.estimators.scan_matching.ledger import AXES
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import turned


def closures_ledger(slam: Slam) -> Innovations:
    """A row for each place that was found for a submap, when the submap was done.

    The residual is the newer node's pose by the match minus that by the graph before it, the older
    node held, along axes of the graph's frame. In the batch mode a closure counts as accepted where
    it is still switched on in the end.
    """
    found, reference = slam.closed.candidates, slam.maps.reference
    accepted = np.array([c.accepted for c in found], dtype=bool)
    if slam.smoothed is not None:
        accepted[accepted] = slam.smoothed.switches >= 0.5
    nodes, count = slam.local.nodes, len(slam.local.nodes)
    done = nodes[np.minimum(slam.maps.stops[[c.new + 1 for c in found]], count - 1)]
    about = [f"node {reference[c.old]} -> node {reference[c.new]}" for c in found]
    n = len(found)
    yaw = np.array([c.yaw for c in found])
    residual = np.array([c.residual for c in found]).reshape(n, 3)
    at_origin = np.column_stack([np.zeros((n, 2)), yaw])
    xy = se2.transform_points(at_origin, residual[:, None, :2])[:, 0]
    return Innovations(
        "loop closure",
        slam.local.t_ns[done],
        np.column_stack([xy, residual[:, 2]]),
        turned(np.array([c.S for c in found]).reshape(n, 3, 3), yaw),
        accepted,
        AXES,
        slam.start.frame_id,
        np.array([c.moved for c in found]).reshape(n, 3),
        np.array(about, dtype=np.str_),
        np.array([c.score for c in found]),
    )
