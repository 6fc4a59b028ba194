"""The residual ledger: every match, taken or not, against what was expected before it."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.run import Innovations
from slamreplay.estimators.pose_graph.slam import Slam
from slamreplay.estimators.scan_matching.local import LocalTrajectory

AXES = ("x m", "y m", "yaw rad")


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


def matches_ledger(local: LocalTrajectory) -> Innovations:
    """A row for each scan that was matched to the local map."""
    rows = [k for k, fit in enumerate(local.fits) if fit is not None and np.isfinite(fit.score)]
    fits = [fit for k in rows if (fit := local.fits[k]) is not None]
    n = len(rows)
    return Innovations(
        "scan match",
        local.t_ns[rows],
        np.array([f.residual for f in fits]).reshape(n, 3),
        np.array([f.S for f in fits]).reshape(n, 3, 3),
        np.array([f.accepted for f in fits], dtype=bool),
        AXES,
        "local",
        np.array([f.moved for f in fits]).reshape(n, 3),
        np.empty(0, dtype="U1"),
        np.array([f.score for f in fits]),
    )
