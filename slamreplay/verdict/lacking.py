"""What evidence the verdict had to do without, and what that leaves open."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.verdict.timing import Delay

#: By whether particles were recorded.
_NO_COVARIANCE = {
    False: "no covariance: whether it knew how unsure it was cannot be told",
    True: "no covariance: how unsure it was is told by its particles alone",
}


def lacking(
    view: BundleView,
    belief: PoseTrack | None,
    hindsight: Hindsight | None,
    delay: Delay | None,
) -> tuple[str, ...]:
    """Sentences, the gravest first; empty where nothing was missing."""
    manifest = view.manifest
    found = []
    if view.grid is None:
        found.append("no map: neither lost nor changed can be judged")
    if hindsight is None or not len(hindsight.track):
        found.append("no hindsight: where the robot really was is not known")
    if belief is None:
        found.append("no belief: whether the robot was lost is not judged")
    elif not np.isfinite(belief.cov[:, :2, :2]).any():
        by_cloud = manifest.topic_of("particles") is not None
        found.append(_NO_COVARIANCE[by_cloud])
    if manifest.topic_of("odometry") is None and manifest.frames.odom is None:
        found.append("no odometry: slip and being carried cannot be told apart")
    if hindsight is not None and len(hindsight.track) and hindsight.margin is None:
        found.append("no second place to compare with: how unique this one is was not measured")
    if hindsight is not None and len(hindsight.track) and delay is None:
        found.append("too few turns: whether scans and odometry share a clock is not known")
    for role, open_ in (
        ("imu", "who is late, and a slip in turning, have no second witness"),
        ("command", "whether it was told to stop is not known"),
        ("costmap", "the clearance is the map's: what stood there that day is not in it"),
        ("recovery", "recoveries and goals are not in the log: stops are seen by motion alone"),
    ):
        if manifest.topic_of(role) is None:
            found.append(f"no {role}: {open_}")
    return tuple(found)
