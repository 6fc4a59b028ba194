"""The maker of scenes: everything a post-mortem and its log have to show, on one time axis."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.scene import Mark, Scene
from slamreplay.evidence.scene_lanes import scene_lanes
from slamreplay.evidence.scene_marks import scene_marks
from slamreplay.evidence.scene_paths import scene_clouds, scene_plans
from slamreplay.evidence.scene_scans import scene_scans
from slamreplay.geometry import se2
from slamreplay.verdict.clearance import inscribed_radius_m

#: Corners of the polygon that stands for a round footprint.
_CORNERS = 24


def scene_of(post: Postmortem, view: BundleView, *, most_scans: int | None = 2400) -> Scene:
    """What there was to see at each moment of a log.

    Args:
        post: what was found in it.
        view: the log, as the post-mortem saw it.
        most_scans: scans of each laser, clouds and plans at the most, clouds and plans thinned;
            None for all of them, whole.
    """
    marks = scene_marks(post, view)
    return Scene(
        scans=scene_scans(post, view, moments_of(marks), most_scans),
        clouds=scene_clouds(post, view, most_scans),
        plans=scene_plans(post, view, most_scans),
        footprint_xy=footprint(view, post.limits.footprint_radius_m),
        marks=marks,
        lanes=scene_lanes(post),
    )


def moments_of(marks: tuple[Mark, ...]) -> list[int]:
    """When what a reader will look at began and ended: stretches, stops and jumps."""
    asked = [m for m in marks if m.kind in ("lost", "map_changed", "stop", "jump")]
    return [t for m in asked for t in (m.t_ns, m.end_ns) if t is not None]


def footprint(view: BundleView, radius_m: float) -> se2.Array:
    """(K, 2) the robot's outline in the base frame: the circle that clearances are told from.

    No table holds a polygon: its inscribed circle is what the costmap's inflation tells of it.

    Args:
        view: the log.
        radius_m: used where no costmap tells the inscribed radius, m.
    """
    costmaps = view.role("costmap")
    told = inscribed_radius_m(costmaps) if costmaps is not None and len(costmaps) else None
    angle = np.arange(_CORNERS) * (2.0 * np.pi / _CORNERS)
    radius = radius_m if told is None else told
    return np.asarray(radius * np.column_stack([np.cos(angle), np.sin(angle)]))
