"""A configuration of RViz 2: the map, the overlays above it, and both paths.

Keys and classes are those of rviz_default_plugins, as nav2_bringup's nav2_default_view.rviz has
them.
"""

from __future__ import annotations

from typing import Any

import yaml

from slamreplay.evidence import colours

#: Of the paths.
_COLOURS = {"belief": colours.BELIEF, "hindsight": colours.HINDSIGHT}
_PIXELS = 900


def rviz_config(
    frame: str, topics: dict[str, str], centre: tuple[float, float], wide_m: float
) -> str:
    """The file's text.

    Args:
        frame: the map's frame.
        topics: name of what is shown (map, appeared, removed, belief, hindsight) to its topic.
        centre: x and y of the middle of the view, m.
        wide_m: what the view is to hold across.
    """
    shown = [
        _path(name, topic) if name in _COLOURS else _map(name, topic)
        for name, topic in topics.items()
    ]
    settings = {
        "Panels": [
            {"Class": "rviz_common/Displays", "Name": "Displays"},
            {"Class": "rviz_common/Views", "Name": "Views"},
        ],
        "Visualization Manager": {
            "Class": "",
            "Displays": shown,
            "Enabled": True,
            "Global Options": {
                "Background Color": "48; 48; 48",
                "Fixed Frame": frame,
                "Frame Rate": 30,
            },
            "Name": "root",
            "Tools": [
                {"Class": "rviz_default_plugins/MoveCamera"},
                {"Class": "rviz_default_plugins/Measure", "Line color": "128; 128; 0"},
            ],
            "Transformation": {"Current": {"Class": "rviz_default_plugins/TF"}},
            "Value": True,
            "Views": {"Current": _view(centre, wide_m), "Saved": None},
        },
        "Window Geometry": {"Height": _PIXELS, "Width": _PIXELS + 400},
    }
    return str(yaml.safe_dump(settings, sort_keys=False, width=200))


def _map(name: str, topic: str) -> dict[str, Any]:
    is_map = name == "map"
    return {
        "Alpha": 1.0 if is_map else 0.7,
        "Class": "rviz_default_plugins/Map",
        "Color Scheme": "map" if is_map else "costmap",
        "Draw Behind": is_map,
        "Enabled": True,
        "Name": name,
        "Topic": _topic(topic),
        "Update Topic": _topic(f"{topic}_updates", durability="Volatile"),
        "Use Timestamp": False,
        "Value": True,
    }


def _path(name: str, topic: str) -> dict[str, Any]:
    return {
        "Alpha": 1.0,
        "Buffer Length": 1,
        "Class": "rviz_default_plugins/Path",
        "Color": "; ".join(map(str, colours.rgb(_COLOURS[name]))),
        "Enabled": True,
        "Line Style": "Billboards",
        "Line Width": 0.05,
        "Name": name,
        "Pose Style": "None",
        "Topic": _topic(topic),
        "Value": True,
    }


def _topic(name: str, durability: str = "Transient Local") -> dict[str, Any]:
    return {
        "Depth": 1,
        "Durability Policy": durability,
        "Filter size": 10,
        "History Policy": "Keep Last",
        "Reliability Policy": "Reliable",
        "Value": name,
    }


def _view(centre: tuple[float, float], wide_m: float) -> dict[str, Any]:
    return {
        "Angle": 0.0,
        "Class": "rviz_default_plugins/TopDownOrtho",
        "Name": "Current View",
        "Scale": round(_PIXELS / max(wide_m, 1.0), 3),
        "Target Frame": "<Fixed Frame>",
        "Value": "TopDownOrtho (rviz_default_plugins)",
        "X": round(centre[0], 3),
        "Y": round(centre[1], 3),
    }
