"""A layout for Foxglove and Lichtblick: the scene from above, states, findings and lanes.

The form is that of an exported layout: `configById` holds each panel's settings by `TYPE!ID`, and
`layout` is a tree of splits. Names of settings are those of Lichtblick's sources
(packages/suite-base/src/panels: ThreeDeeRender/IRenderer.ts RendererConfig, Plot/utils/config.ts,
StateTransitions/types.ts, Log/types.ts), which Foxglove shares; colours of states are Foxglove's
alone (`customStates` of its SDK's layouts), and other viewers pass over them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from slamreplay.evidence import colours
from slamreplay.evidence.scene import Lane, LaneKey
from slamreplay.evidence.words import STATES
from slamreplay.export.foxglove import topics
from slamreplay.export.plane import from_above
from slamreplay.export.shown import BASE_BELIEVED, BASE_HINDSIGHT, Shown

#: Width over height of the panel on a usual screen.
_ASPECT = 1.6
#: Lanes of one unit share a plot: title, lanes and their colours.
_PLOTS: tuple[tuple[str, dict[LaneKey, str]], ...] = (
    ("Error (red) and sigma (blue) [m]", {"error_m": colours.VERMILLION, "sigma_m": colours.SKY}),
    ("Heading error [deg]", {"error_deg": colours.VERMILLION}),
    ("NEES", {"nees": colours.PURPLE}),
    (
        "Share of changed beams (orange), match (green)",
        {"changed_share": colours.ORANGE, "match": colours.GREEN},
    ),
)
Config = dict[str, Any]


def layout(shown: Shown, schemas: Mapping[str, str]) -> Config:
    """The layout as JSON values; only topics that were written are in it.

    Args:
        shown: what was written.
        schemas: topic to schema of all that was written.
    """
    panels: dict[str, Config] = {"3D!slamreplay": _scene(shown, schemas)}
    if topics.STATE in schemas:
        panels["StateTransitions!slamreplay"] = _states()
    panels["RawMessages!slamreplay"] = {
        "topicPath": topics.VERDICT,
        "diffTopicPath": "",
        "diffMethod": "custom",
        "diffEnabled": False,
        "showFullMessageForDiff": False,
        "expansion": "all",
        **_titled("Verdict"),
    }
    panels["RosOut!slamreplay"] = {
        "searchTerms": [],
        "minLogLevel": 1,
        "topicToRender": topics.FINDINGS,
        **_titled("Findings"),
    }
    side = [name for name in panels if not name.startswith("3D")]
    lanes = {lane.key: lane for lane in shown.lanes if topics.lane(lane.key) in schemas}
    plots = []
    for number, (title, of) in enumerate(_PLOTS, start=1):
        own = [(lanes[key], colour) for key, colour in of.items() if key in lanes]
        if own:
            plots.append(f"Plot!slamreplay{number}")
            panels[plots[-1]] = _plot(title, own)
    upper = _split(["3D!slamreplay", _split(side, "column", first=22.0)], "row", first=68.0)
    tree = _split([upper, _split(plots, "row")], "column", first=70.0) if plots else upper
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": tree,
    }


def _split(parts: Sequence[Any], direction: str, first: float | None = None) -> Any:
    """A tree of splits in two; all parts of one size unless the first one is told a per cent."""
    if len(parts) == 1:
        return parts[0]
    return {
        "first": parts[0],
        "second": _split(parts[1:], direction),
        "direction": direction,
        "splitPercentage": 100.0 / len(parts) if first is None else first,
    }


def _titled(title: str) -> Config:
    return {"foxglovePanelTitle": title, "lichtblickPanelTitle": title}


def _scene(shown: Shown, schemas: Mapping[str, str]) -> Config:
    centre, height = from_above(shown, _ASPECT)
    return {
        "cameraState": {
            "perspective": False,
            "distance": height,  # of what is seen, where there is no perspective
            "phi": 0,
            "thetaOffset": 0,  # x to the right
            "targetOffset": [float(centre[0]), float(centre[1]), 0],
            "target": [0, 0, 0],
            "targetOrientation": [0, 0, 0, 1],
            "fovy": 45,
            "near": 0.5,
            "far": 5000,
        },
        "followMode": "follow-pose",
        "followTf": shown.frame_id,
        "scene": {
            "backgroundColor": colours.GROUND,
            "transforms": {"showLabel": False, "axisScale": 0.5, "lineWidth": 0},
        },
        "transforms": {
            f"frame:{shown.frame_id}": {"visible": False},
            f"frame:{BASE_BELIEVED}": {"visible": True},
            f"frame:{BASE_HINDSIGHT}": {"visible": True},
        },
        "topics": {
            topic: found
            for topic, schema in sorted(schemas.items())
            if (found := _drawn(topic, schema, shown)) is not None
        },
        "layers": {},
        "publish": {},
        "imageMode": {},
        **_titled("Belief and hindsight"),
    }


def _drawn(topic: str, schema: str, shown: Shown) -> Config | None:
    """How a topic is drawn, None for those that are not drawn."""
    kind = schema.removeprefix("foxglove.")
    if kind in ("Grid", "PointCloud") and topic != topics.PARTICLES:
        field = "met" if kind == "PointCloud" else "occupancy"
        field = "change" if topic == topics.CHANGED_CELLS else field
        told = {"visible": True, "colorMode": "rgba-fields", "colorField": field}
        return told if kind == "Grid" else {**told, "pointSize": 4, "pointShape": "circle"}
    if topic == topics.PARTICLES:
        return {"visible": True, "colorMode": "flat", "flatColor": colours.BELIEF, "pointSize": 2}
    if kind == "PoseInFrame":
        robot = {
            topics.pose(topics.BELIEF): colours.BELIEF,
            topics.pose(topics.HINDSIGHT): colours.HINDSIGHT,
        }
        return {
            "visible": topic in robot,
            "type": "arrow",
            "color": robot.get(topic, colours.GREY),
            "arrowScale": [0.6, 0.08, 0.08],
        }
    if kind == "SceneUpdate":
        frames = {topics.path(topics.run(n)): t.frame_id for n, t in shown.runs}
        return {"visible": frames.get(topic, shown.frame_id) == shown.frame_id}
    return None


def _states() -> Config:
    known = [
        {"value": state, "label": STATES[state].name, "color": colour}
        for state, colour in colours.STATES.items()
    ]
    path = {
        "value": f"{topics.STATE}.state",
        "label": "State",
        "enabled": True,
        "timestampMethod": "receiveTime",
        "customStates": {"type": "discrete", "states": known},
    }
    return {"paths": [path], "isSynced": True, **_titled("State")}


def _plot(title: str, lanes: Sequence[tuple[Lane, str]]) -> Config:
    paths = []
    for lane, colour in lanes:
        common = {"enabled": True, "timestampMethod": "receiveTime"}
        unit = f" [{lane.unit}]" if lane.unit else ""
        paths.append(
            {
                **common,
                "value": f"{topics.lane(lane.key)}.value",
                "label": f"{lane.title}{unit}",
                "color": colour,
                "showLine": True,
                "lineSize": 1.5,
            }
        )
        if lane.limit is not None:  # a path that is a number is a level line
            limit = {"value": f"{lane.limit:g}", "label": "limit"}
            paths.append({**common, **limit, "color": colours.GREY})
    return {
        "paths": paths,
        "showLegend": False,  # it would cover half of a plot this small; titles say it,
        "legendDisplay": "floating",
        "showPlotValuesInLegend": False,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "isSynced": True,
        "xAxisVal": "timestamp",
        "sidebarDimension": 240,
        **_titled(title),
    }
