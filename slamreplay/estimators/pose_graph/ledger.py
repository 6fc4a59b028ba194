"""The residual ledger of loop closures: each place found, against where it was expected."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.run import Innovations
from slamreplay.estimators.pose_graph.slam import Slam
from slamreplay.estimators.scan_matching.ledger import AXES


def closures_ledger(slam: Slam) -> Innovations:
    """A row for each place that was found for a submap, when the submap was done.

    The residual is along axes of the older node. In the batch mode a closure counts as accepted
    where it is still switched on in the end.
    """
    found, reference = slam.closed.candidates, slam.maps.reference
    accepted = np.array([c.accepted for c in found], dtype=bool)
    if slam.smoothed is not None:
        accepted[accepted] = slam.smoothed.switches >= 0.5
    nodes, count = slam.local.nodes, len(slam.local.nodes)
    done = nodes[np.minimum(slam.maps.stops[[c.new + 1 for c in found]], count - 1)]
    about = [f"node {reference[c.old]} -> node {reference[c.new]}" for c in found]
    n = len(found)
    return Innovations(
        "loop closure",
        slam.local.t_ns[done],
        np.array([c.residual for c in found]).reshape(n, 3),
        np.array([c.S for c in found]).reshape(n, 3, 3),
        accepted,
        AXES,
        "base of the older node",
        np.array([c.moved for c in found]).reshape(n, 3),
        np.array(about, dtype=np.str_),
        np.array([c.score for c in found]),
    )
