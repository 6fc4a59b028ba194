"""Who plays what in a log: roles and frames settled together, for each needs the other."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from slamreplay.bundle.manifest import FrameEdge, Frames, Loss
from slamreplay.bundle.role_tables import ROLE_TABLES
from slamreplay.errors import UsageError
from slamreplay.ingest import roles
from slamreplay.ingest.changes import settle_changes
from slamreplay.ingest.dead_reckoning import dead_reckoned, is_carried, objection
from slamreplay.ingest.doubles import without_doubles
from slamreplay.ingest.frames import direct_pose, find_frames, settle, without_frame
from slamreplay.ingest.lasers import second_scan
from slamreplay.ingest.leaks import repeated_reference
from slamreplay.ingest.log_lines import told_in_logs
from slamreplay.ingest.names import SCORES, is_map_frame, is_reference, tokens
from slamreplay.ingest.roles import Choice
from slamreplay.ingest.rows import TopicRows
from slamreplay.ingest.sightings import tag_sightings
from slamreplay.ingest.tables import moved


@dataclass(frozen=True, eq=False)
class Cast:
    """The settled topics of a log.

    Attributes:
        topics: all topics with rows; tf rows form a forest.
        choices: role to the topic that plays it.
        frames: map, odom, base and the tree.
        losses: what tf lost on the way.
    """

    topics: list[TopicRows]
    choices: dict[str, Choice]
    frames: Frames
    losses: list[Loss]


def settle_cast(topics: Sequence[TopicRows], overrides: Mapping[str, str]) -> Cast:
    """Roles and frames of a log.

    Args:
        topics: rows of all topics.
        overrides: what the user says, by role and by `*_frame`.

    Raises:
        UsageError: a topic's type cannot play the role it was given.
    """
    settled = settle([t for t in topics if t.table == "transforms"])
    tf_rows = settled.topics
    others, ended = settle_changes([t for t in topics if t.table != "transforms"])
    others += told_in_logs(others)
    losses = [*settled.losses, *ended]
    free = _not_given(others, overrides)
    given = {r: _given(r, n, [*others, *tf_rows]) for r, n in overrides.items() if r in ROLE_TABLES}
    found: dict[str, Choice | None] = {
        "odometry": roles.choose_odometry(free("odometry"), tf_rows),
        "imu": roles.choose_imu(free("imu")),
        "scan": roles.choose_scan(free("scan")),
        "reference": roles.choose_reference(free("reference")),
        "map": roles.choose_map(free("map")),
        "costmap": roles.choose_costmap(free("costmap")),
        "particles": roles.choose_particles(free("particles")),
    }
    found |= given
    map_frames = _map_frames(others, found)
    named = overrides
    if found["odometry"] is None:
        here = find_frames(settled.tree, None, map_frames, overrides, lambda *_: False)
        made, lost = _dead_reckoned(free("velocity"), found, settled.tree, here)
        losses += lost
        if made is not None:
            others.append(made.rows)
            found["odometry"] = made
            named = {"odom_frame": made.rows.frame(), **overrides}
    odometry = found["odometry"]
    references = [t for t in others if is_reference(t.topic) and t.table in ("poses", "odometry")]
    disguised: dict[str, str] = {}

    def is_disguise(frame: str, odom: str, base: str) -> bool:
        topic = repeated_reference(frame, odom, base, tf_rows, references)
        if topic is not None:
            disguised[frame] = topic
        return topic is not None

    odometry_rows = odometry.rows if odometry else None
    frames = find_frames(settled.tree, odometry_rows, map_frames, named, is_disguise)
    frames = frames.model_copy(update={"left_out": settled.left_out})
    for frame, topic in disguised.items():
        if frame != frames.map:
            frames, tf_rows, loss = without_frame(frame, topic, frames, tf_rows)
            losses.append(loss)
    found |= {
        "pose": roles.choose_pose([*free("pose"), *tf_rows], frames),
        "initial_pose": roles.choose_initial_pose(free("initial_pose")),
        "points": roles.choose_simple(free("points"), "points", "point cloud", ("points",)),
        "plan": roles.choose_simple(free("plan"), "plans", None, ("plan", "path")),
        "command": roles.choose_command(free("command")),
        "velocity": roles.choose_velocity(free("velocity")),
        **_others(free),
        "recovery": roles.choose_recovery(free("recovery")),
    }
    if (first := found["scan"]) is not None:
        found["scan"], found["scan_2"] = second_scan(free("scan_2"), first, tf_rows, frames)
    found |= given
    if found["pose"] is None and (direct := direct_pose(tf_rows, frames)) is not None:
        others.append(direct)
        found["pose"] = Choice(direct, f"tf {frames.map} -> {frames.base}, without an odom between")
    pose = found["pose"]
    if "covariance" not in found and pose is not None and roles.has_covariance(pose.rows):
        found["covariance"] = Choice(pose.rows, "the pose's own")
    choices = {role: choice for role, choice in found.items() if choice is not None}
    seen, others, doubles = without_doubles(tag_sightings(tf_rows), others)
    return Cast([*others, *seen, *tf_rows], choices, frames, [*losses, *doubles])


def _dead_reckoned(
    topics: Sequence[TopicRows],
    found: Mapping[str, Choice | None],
    tree: Sequence[FrameEdge],
    frames: Frames,
) -> tuple[Choice | None, list[Loss]]:
    """Odometry made of measured velocities where tf has none either."""
    if is_carried(tree, frames):
        return None, []
    given = found.get("velocity")
    velocities = [
        t for t in topics if t.table == "velocities" and len(t) and not roles.is_command(t)
    ]
    if given is not None:
        velocities = [moved(given.rows, "velocities")]
    against = {id(t): objection(t) for t in velocities}
    velocity = roles.best_velocity([t for t in velocities if against[id(t)] is None])
    if velocity is None:
        return None, [
            Loss(kind="skipped", what=t.topic, count=len(t), reason=f"not dead-reckoned: {why}")
            for t in velocities if (why := against[id(t)])
        ]  # fmt: skip
    rows = velocity.rows
    made, losses = dead_reckoned(rows, tree, frames.base)
    reason = f"dead-reckoned from the velocities of {roles.type_name(rows.type)}"
    return Choice(made, reason), losses


def _others(free: Callable[[str], list[TopicRows]]) -> dict[str, Choice | None]:
    """Roles of one message type each, that no other role hangs on."""
    simple = {
        "joints": ("joints", "sensor_msgs/JointState", ("joint_states",)),
        "magnetic_field": ("magnetic_fields", "sensor_msgs/MagneticField", ("mag",)),
        "closure": ("closures", "closures of a SLAM system", ("info", "constraint_list")),
        "clock": ("clock", "rosgraph_msgs/Clock", ("clock",)),
        "quality": ("signals", "a localizer's word on itself", SCORES),
    }
    return {role: roles.choose_simple(free(role), *how) for role, how in simple.items()}


def _not_given(topics: Sequence[TopicRows], overrides: Mapping[str, str]):  # type: ignore[no-untyped-def]
    """Topics a role may choose from: those the user gave to no other role."""
    pair = {"pose", "covariance"}

    def free(role: str) -> list[TopicRows]:
        taken = {n for r, n in overrides.items() if r != role and not {r, role} <= pair}
        return [t for t in topics if t.topic not in taken]

    return free


def _given(role: str, name: str, topics: Sequence[TopicRows]) -> Choice:
    table = ROLE_TABLES[role]
    fitting = {
        "references": ("poses", "odometry", "references"),
        "initial_poses": ("poses", "initial_poses"),
        "poses": ("poses", "odometry", "transforms"),
        "map_updates": ("costmaps",),
        "commands": ("commands", "velocities"),
        "velocities": ("velocities", "commands"),
    }.get(table, (table,))
    named = [t for t in topics if t.topic == name]
    rows = next((t for t in named if t.table in fitting), None)
    if rows is None:
        types = ", ".join(t.type for t in named) or "nothing"
        raise UsageError(f"{types} cannot play {role}", where=name)
    return Choice(rows, "given with --topics")


def _map_frames(topics: Sequence[TopicRows], found: Mapping[str, Choice | None]) -> list[str]:
    """Frames that a localizer's poses, particles or the map itself are in, best first."""
    estimates = [t for t in topics if t.table == "poses" and is_map_frame(t.frame())]
    estimates.sort(key=lambda t: ("amcl" not in tokens(t.topic), -t.messages, t.topic))
    others = [found[role] for role in ("map", "particles")]
    frames = [t.frame() for t in estimates] + [c.rows.frame() for c in others if c is not None]
    return list(dict.fromkeys(f for f in frames if f))
