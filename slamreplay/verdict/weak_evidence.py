"""When so much of the map is contradicted that the map itself is in doubt.

A hall of which most stands elsewhere is possible; a map that the robot did not drive with is more
likely, and then "the aisle had changed" says nothing about the aisle.
"""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.products import Changes
from slamreplay.bundle.view import BundleView
from slamreplay.verdict.judgement import ConstantOffset
from slamreplay.verdict.limits import Limits

#: From this median share of changed beams on, over the scans that contradict the map at all.
MOST = 0.5


def doubt_of_map(
    view: BundleView, changes: Changes | None, offset: ConstantOffset | None, limits: Limits
) -> str | None:
    """A clause that says so; None where less is contradicted or the log itself holds this map.

    Args:
        view: the log; a map that it recorded, in the frame it was used in, is the robot's own.
        changes: share of changed beams of each scan.
        offset: between belief and map.
        limits: from which share on a scan contradicts the map.
    """
    if changes is None or view.grid is None:
        return None
    share = changes.changed_share[np.isfinite(changes.changed_share)]
    share = share[share > limits.changed_share]
    if not len(share) or np.median(share) <= MOST:
        return None
    foreign = offset is not None and offset.cause == "map"
    if not foreign and view.grid.version in set(view.table("map_updates")["map_version"]):
        return None
    percent = 100.0 * float(np.median(share))
    return f"weak evidence: {percent:.0f} % of the beams differ, was this its map?"
