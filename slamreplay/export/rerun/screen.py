"""The blueprint that a recording is opened with: the map, and below it all that is plotted."""

from __future__ import annotations

from typing import Any

import rerun.blueprint as rrb

from slamreplay.evidence import colours
from slamreplay.export.plane import from_above
from slamreplay.export.rerun.batches import rgba
from slamreplay.export.shown import Shown

#: Width over height of the view, and how far the eye is for each metre of height.
_ASPECT, _BACK = 1.6, 1.1
_PLOTS = (
    ("Error and sigma [m]", ("error_m", "sigma_m")),
    ("Heading error [deg]", ("error_deg",)),
    ("NEES", ("nees",)),
    ("Changed beams and match", ("changed_share", "match")),
)


def screen(shown: Shown) -> Any:
    """Map, states and findings above; lanes below."""
    known = {lane.key for lane in shown.lanes}
    plots = [
        rrb.TimeSeriesView(
            origin="lanes",
            contents=[f"lanes/{key}/**" for key in keys if key in known],
            name=title,
            plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
        )
        for title, keys in _PLOTS
        if known & set(keys)
    ]
    side = rrb.Vertical(
        rrb.TextDocumentView(origin="verdict", name="Verdict"),
        rrb.StateTimelineView(origin="state", name="State"),
        rrb.TextLogView(origin="findings", name="Findings"),
        row_shares=[3, 1, 3],
    )
    upper = rrb.Horizontal(_scene(shown), side, column_shares=[2, 1])
    if not plots:
        return rrb.Blueprint(upper, collapse_panels=True)
    lanes = rrb.Horizontal(*plots)
    return rrb.Blueprint(rrb.Vertical(upper, lanes, row_shares=[2, 1]), collapse_panels=True)


def _scene(shown: Shown) -> Any:
    """The map from above, x to the right."""
    (x, y), height = from_above(shown, _ASPECT)
    eye = rrb.EyeControls3D(
        position=[x, y, height * _BACK],
        look_target=[x, y, 0.0],
        eye_up=[0.0, 1.0, 0.0],
    )
    return rrb.Spatial3DView(
        origin="map",
        name="Belief and hindsight",
        background=rgba(colours.GROUND),
        line_grid=False,
        eye_controls=eye,
    )
