"""What the names of topics and frames say, whatever namespace they stand in."""

from __future__ import annotations

import re

_TOKENS = re.compile(r"[a-z]+|\d+")
_CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")


def tokens(name: str) -> list[str]:
    """Words of a topic, in order: "/robot1/amcl_pose" gives robot, 1, amcl, pose."""
    return _TOKENS.findall(_CAMEL.sub("_", name).lower())


def basename(name: str) -> str:
    """The last part of a topic or frame, in lower case: "/robot1/odom" gives "odom"."""
    return name.rstrip("/").rpartition("/")[2].lower()


def is_map_frame(frame: str) -> bool:
    """REP-105's map, in whatever namespace; also the `map` part of longer names."""
    return "map" in tokens(basename(frame))


def is_odom_frame(frame: str) -> bool:
    """REP-105's odom: "odom", "robot1/odom", "odom_combined"."""
    return any(word.startswith("odom") for word in tokens(basename(frame)))


def is_base_frame(frame: str) -> bool:
    """REP-105's base: "base_link", "base_footprint", "base", in whatever namespace."""
    words = tokens(basename(frame))
    return words in (["base"], ["base", "link"], ["base", "footprint"]) or (
        words[-2:] in (["base", "link"], ["base", "footprint"])
    )


_TRUTH = frozenset({"gt", "groundtruth", "truth", "mocap", "vicon", "vrpn", "optitrack",
                    "qualisys", "phasespace", "natnet"})  # fmt: skip


def is_reference(topic: str) -> bool:
    """Whether a topic's name claims an independent idea of the truth."""
    return bool(_TRUTH & set(tokens(topic))) or topic.strip("/") == "slamreplay/reference"


def is_gnss(topic: str) -> bool:
    """Whether a topic's name says that a satellite receiver made it: positions without heading."""
    return bool({"gps", "gnss", "navsat", "rtk"} & set(tokens(topic)))


#: Words of those who command, in names of velocities that were not measured.
_COMMANDERS = frozenset({"joy", "joystick", "teleop", "key", "keyboard", "nav", "mux", "target",
                         "desired", "ref", "reference", "setpoint"})  # fmt: skip


def is_commanded(topic: str) -> bool:
    """Whether the name of a velocity says that it was asked for: "cmd_vel", "joy_vel"."""
    words = tokens(topic)
    return any(w.startswith(("cmd", "command")) for w in words) or bool(_COMMANDERS & set(words))


#: Scores by their own names: als_ros, emcl2, Autoware's NDT; the best kept first.
SCORES = ("reliability", "failure_probability", "nearest_voxel_transformation_likelihood",
          "transform_probability", "alpha")  # fmt: skip
_SCORED = frozenset({"score", "confidence", "quality", "reliability", "likelihood", "fitness",
                     "probability"})  # fmt: skip
_SCORERS = frozenset({"localization", "localisation", "localizer", "localiser", "amcl", "mcl",
                      "ndt", "icp", "slam", "matching", "matcher", "match"})  # fmt: skip


def is_quality(topic: str) -> bool:
    """Whether a name says that a number is a localizer's word on itself: "/ndt/fitness_score"."""
    words = set(tokens(topic))
    return basename(topic) in SCORES or bool(words & _SCORED and words & _SCORERS)


def is_slam_graph(topic: str) -> bool:
    """Whether markers are called like a SLAM graph's: "constraint_list", "graph_visualization"."""
    return bool({"graph", "constraint", "constraints"} & set(tokens(basename(topic))))


def is_sensed_dock(topic: str) -> bool:
    """Nav2's `detected_dock_pose`: the dock as the robot sensed it, not where it should be."""
    words = tokens(basename(topic))
    return "dock" in words and bool({"detected", "detection"} & set(words))


#: Poses of Nav2's docking server beside the detected one, and what they are (simple_charging_dock).
_DOCKING = {
    "dock_pose": "where docking takes the dock to be: as it was given, or made of detections",
    "filtered_dock_pose": "detections of the dock, smoothed: no measurement of its own",
    "staging_pose": "where docking begins: a goal",
}


def why_no_dock(topic: str) -> str | None:
    """Why a pose of the docking server is no sighting of the dock; None for other topics."""
    return _DOCKING.get(basename(topic))


def is_path(topic: str) -> bool:
    """Whether a topic's name says that its poses follow each other: "/plan", "/robot1/path"."""
    named = {"plan", "plans", "path", "paths", "trajectory", "route", "waypoints"}
    return bool(named & set(tokens(topic)))
