"""Which topic is what: by type first, then by name, then by frames and content, with the reason."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.manifest import Frames
from slamreplay.bundle.recoveries import NAVIGATIONS, tells_of_every_recovery
from slamreplay.bundle.schema import JUDGING_KINDS
from slamreplay.ingest.action_names import action_of, is_recovery, service_of
from slamreplay.ingest.names import (
    basename,
    is_commanded,
    is_gnss,
    is_map_frame,
    is_odom_frame,
    is_reference,
    tokens,
)
from slamreplay.ingest.rows import TopicRows
from slamreplay.ingest.valid_beams import valid_beams

#: Where a topic with one of these words stands on the way to a goal, not at the robot.
_NOT_A_BELIEF = frozenset({"goal", "goals", "target", "waypoint", "waypoints", "dock", "docking",
                           "staging", "plan", "tag", "tags", "marker", "fiducial",
                           "initialpose"})  # fmt: skip
_BELIEF = frozenset({"pose", "amcl", "mcl", "localization", "localisation", "localizer", "slam",
                     "estimate", "estimated", "kinematic"})  # fmt: skip


@dataclass(frozen=True, eq=False)
class Choice:
    """The topic that plays a role, and why."""

    rows: TopicRows
    reason: str


Rank = Callable[[TopicRows], tuple[object, ...]]


def is_initial_pose(topic: TopicRows) -> bool:
    """A pose that was given to the localizer."""
    words = "".join(tokens(basename(topic.topic)))
    if topic.table == "initial_poses":
        return True
    return topic.table == "poses" and words.startswith(("initialpose", "setpose"))


def is_costmap(topic: TopicRows) -> bool:
    """A cost grid, not a map: by type or by name."""
    words = tokens(topic.topic)
    named = "costmap" in words or any(w.startswith("costmap") for w in words)
    typed = topic.type.endswith(("/Costmap", "/VoxelGrid"))
    return topic.table == "costmaps" and (named or typed)


def choose_reference(topics: Sequence[TopicRows]) -> Choice | None:
    """An independent idea of the truth, which only judges."""
    found = [t for t in topics if t.table in ("poses", "odometry") and is_reference(t.topic)]
    found += [t for t in topics if t.table == "references" and _judges(t)]
    return _pick(found, lambda t: (t.messages,), "named as a reference", "most messages")


def choose_odometry(topics: Sequence[TopicRows], tf: Sequence[TopicRows]) -> Choice | None:
    """Dead reckoning: an Odometry that is neither in a map frame nor a reference."""
    found = [
        t for t in topics if t.table == "odometry" and len(t) and not is_reference(t.topic)
        and not is_map_frame(t.frame()) and not is_gnss(t.topic)
    ]  # fmt: skip
    edges = {
        (p, c) for t in tf for p, c in zip(t.columns["parent_frame"], t.columns["child_frame"],
                                           strict=True)
    }  # fmt: skip

    def rank(t: TopicRows) -> tuple[object, ...]:
        on_tf = (t.frame(), t.frame("child_frame_id")) in edges
        return (on_tf, is_odom_frame(t.frame()), "odom" in tokens(t.topic), t.messages)

    return _pick(found, rank, None, "its frames are those of tf, then by name")


def choose_imu(topics: Sequence[TopicRows]) -> Choice | None:
    """The IMU that measures turn rates most often."""
    found = [t for t in topics if t.table == "imu" and len(t)]

    def rank(t: TopicRows) -> tuple[object, ...]:
        return (bool(np.isfinite(t.columns["angular_velocity_xyz"]).any()), t.messages)

    return _pick(found, rank, None, "most turn rates")


def choose_scan(topics: Sequence[TopicRows]) -> Choice | None:
    """One laser: the most valid beams in all; of nearly equal ones the plainer name."""
    found = [t for t in topics if t.table == "scans" and len(t)]
    if not found:
        return None
    if len(found) == 1:
        return Choice(found[0], f"{type_name(found[0].type)}, the only one")
    beams = {id(t): valid_beams(t) for t in found}
    most = max(beams.values())
    close = [t for t in found if beams[id(t)] >= 0.9 * most]

    def rank(t: TopicRows) -> tuple[object, ...]:
        delay = float(np.median((t.t_log_ns - t.t_sensor_ns).astype(np.float64)))
        return ("scan" in basename(t.topic), -len(tokens(t.topic)), -delay, beams[id(t)])

    chosen = max(close, key=lambda t: (*rank(t), t.topic))
    tied = f", one of {len(close)} alike, the plainest name" if len(close) > 1 else ""
    reason = f"densest of {len(found)} lasers ({beams[id(chosen)]:.0f} valid beams{tied})"
    return Choice(chosen, reason)


def choose_pose(topics: Sequence[TopicRows], frames: Frames) -> Choice | None:
    """The localizer's own estimate: a pose with covariance in the map, else other poses there.

    The correction map -> odom on tf comes between the two: it is what the robot drove by.
    """
    found = [t for t in topics if len(t) and is_estimate(t, frames)]
    with_covariance = [t for t in found if t.type.endswith("/PoseWithCovarianceStamped")]
    tf = _correction(topics, frames)

    def rank(t: TopicRows) -> tuple[object, ...]:
        words = set(tokens(t.topic))
        return ("amcl" in words, bool(words & _BELIEF), t.messages)

    if with_covariance or tf is None:
        why = "pose in the map frame"
        chosen = _pick(with_covariance or found, rank, why, "by name, then most messages")
        if chosen and tf:
            also = f"; tf {frames.map} -> {frames.odom} carries it between its messages"
            return Choice(chosen.rows, chosen.reason + also)
        return chosen
    above = f"tf between {frames.map} and {frames.odom}"
    return Choice(tf, f"{above} is the only word of a localizer")


def choose_particles(topics: Sequence[TopicRows]) -> Choice | None:
    """A particle cloud: by type, or a PoseArray that is called one."""
    found = [
        t for t in topics if t.table == "particles" and len(t)
        and (t.type.endswith("/ParticleCloud") or any("particle" in w for w in tokens(t.topic)))
    ]  # fmt: skip
    return _pick(found, lambda t: (bool(t.columns["weights"].values.size), t.messages),
                 "particles of the localizer", "with weights, then most messages")  # fmt: skip


def choose_map(topics: Sequence[TopicRows]) -> Choice | None:
    """The OccupancyGrid the robot localised in."""
    found = [t for t in topics if t.table == "costmaps" and len(t) and not is_costmap(t)
             and "map" in "".join(tokens(t.topic))]  # fmt: skip
    found = found or [t for t in topics if t.table == "costmaps" and len(t) and not is_costmap(t)]
    return _pick(found, lambda t: (basename(t.topic) == "map", t.columns["width"].max()),
                 None, "called map, then the largest")  # fmt: skip


def choose_costmap(topics: Sequence[TopicRows]) -> Choice | None:
    """The local costmap; a global one where there is no other. Voxels are what it is made of."""
    found = [t for t in topics if len(t) and is_costmap(t)]

    def rank(t: TopicRows) -> tuple[object, ...]:
        return ("local" in tokens(t.topic), not t.type.endswith("/VoxelGrid"), t.messages)

    return _pick(found, rank, "cost grid", "local before global")


def choose_simple(
    topics: Sequence[TopicRows], table: str, what: str | None, preferred: Sequence[str]
) -> Choice | None:
    """The topic with most messages in a table; names that end in a preferred word come first."""
    found = [t for t in topics if t.table == table and len(t)]
    return _pick(found, _by_name(*preferred), what, "by name, then most messages")


def _by_name(*preferred: str) -> Rank:
    def rank(t: TopicRows) -> tuple[object, ...]:
        name = basename(t.topic)
        place = [-i for i, word in enumerate(preferred) if name == word]
        return (place[0] if place else -len(preferred), t.messages)

    return rank


def choose_recovery(topics: Sequence[TopicRows]) -> Choice | None:
    """Where recoveries are told of; that none happened is an answer too, but for log lines."""
    found = [t for t in topics if t.table == "recoveries" and _tells_of_recoveries(t)]

    def rank(t: TopicRows) -> tuple[object, ...]:
        return (not t.type.endswith("/Log"), tells_of_every_recovery(t.type), len(t), t.messages)

    order = "a navigator before single actions and log lines, then most of them"
    return _pick(found, rank, "recovery actions", order)


def _tells_of_recoveries(topic: TopicRows) -> bool:
    """Whether recoveries would be in this topic: not where it tells of goals or docking alone."""
    action = action_of(topic.topic)
    if topic.type.endswith("/Log"):
        return bool((~np.isin(topic.columns["name"].astype(str), sorted(NAVIGATIONS))).any())
    if topic.type.endswith(("/GoalStatusArray", "_SendGoal_Event")):
        return is_recovery(action)
    if topic.type == "std_srvs/srv/Empty_Event":
        return is_recovery(service_of(topic.topic))
    return "/MoveBaseAction" not in topic.type and "/DockRobot_" not in topic.type


def choose_initial_pose(topics: Sequence[TopicRows]) -> Choice | None:
    """Where poses were given to the localizer: a topic before calls of its service."""
    found = [t for t in topics if len(t) and is_initial_pose(t)]
    return _pick(found, _by_name("initialpose"), "named as one", "by name, then most messages")


def is_command(topic: TopicRows) -> bool:
    """What the base was told; a stamped twist without such a name is a measurement."""
    if topic.table == "velocities":
        return topic.type.endswith("/TwistStamped") and is_commanded(topic.topic)
    return topic.table == "commands"


def choose_command(topics: Sequence[TopicRows]) -> Choice | None:
    """What the base was told."""
    found = [t for t in topics if len(t) and is_command(t)]
    return _pick(found, _by_name("cmd_vel", "command"), "velocity command",
                 "by name, then most messages")  # fmt: skip


def choose_velocity(topics: Sequence[TopicRows]) -> Choice | None:
    """The measured velocity that tells most often; one with a covariance first."""
    return best_velocity(
        [t for t in topics if t.table == "velocities" and len(t) and not is_command(t)]
    )


def best_velocity(found: Sequence[TopicRows]) -> Choice | None:
    """Of topics that are known to be measured velocities."""

    def rank(t: TopicRows) -> tuple[object, ...]:
        return (bool(np.isfinite(t.columns["twist_covariance"]).all(axis=1).any()), t.messages)

    return _pick(found, rank, "measured velocity", "with covariance, then most messages")


def type_name(kind: str) -> str:
    """A message type as people write it: "sensor_msgs/LaserScan"."""
    return kind.replace("/msg/", "/")


def _pick(found: Sequence[TopicRows], rank: Rank, what: str | None, order: str) -> Choice | None:
    """The topic that ranks highest; `what` it is, or None for its type."""
    if not found:
        return None
    chosen = max(found, key=lambda t: (rank(t), t.topic))
    what = what or type_name(chosen.type)
    if len(found) == 1:
        return Choice(chosen, f"{what}, the only one")
    return Choice(chosen, f"{what}, chosen of {len(found)}: {order}")


def is_estimate(topic: TopicRows, frames: Frames) -> bool:
    """Whether a topic says where the robot is in a map, for all its type and name tell."""
    words = set(tokens(topic.topic))
    if is_reference(topic.topic) or is_gnss(topic.topic):
        return False
    if words & _NOT_A_BELIEF or is_initial_pose(topic):
        return False
    in_map = topic.frame() == frames.map or is_map_frame(topic.frame())
    if topic.table == "odometry":
        return in_map
    if topic.table != "poses" or is_odom_frame(topic.frame()):
        return False
    return in_map and (bool(words & _BELIEF) or topic.type.endswith("WithCovarianceStamped"))


def _judges(topic: TopicRows) -> bool:
    return bool(len(topic)) and set(topic.columns["kind"]) <= JUDGING_KINDS


def _correction(topics: Sequence[TopicRows], frames: Frames) -> TopicRows | None:
    """The tf topic with most rows of the edge between map and odom."""
    ends = {frames.map, frames.odom}
    counts = {}
    for topic in topics:
        if topic.table == "transforms":
            pairs = zip(topic.columns["parent_frame"], topic.columns["child_frame"], strict=True)
            counts[id(topic)] = sum({p, c} == ends for p, c in pairs)
    found = [t for t in topics if counts.get(id(t), 0)]
    return max(found, key=lambda t: (counts[id(t)], t.topic)) if found else None


def has_covariance(topic: TopicRows) -> bool:
    """Whether the type carries a covariance (an all-zero one is judged later, not here)."""
    column = {"poses": "covariance", "odometry": "pose_covariance"}.get(topic.table)
    return column is not None and bool(np.isfinite(topic.columns[column]).all(axis=1).any())
