"""CARMEN logs (.clf, .log): one message a line, of the Carnegie Mellon Robot Navigation Toolkit.

Stamps are the ipc times (third field from the end): when a message was made, and what published
ground truth refers to. Log times are the logger's, seconds since it was started.

ODOM lines are the odometry. The odometry that laser lines repeat is left out beside them: some
loggers wrote the last ODOM line's there, seconds old. It is read where ODOM lines are missing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from slamreplay.bundle.manifest import Loss
from slamreplay.errors import UsageError
from slamreplay.geometry.times import NO_STAMP
from slamreplay.ingest.rows import TopicRows
from slamreplay.ingest.text_logs.carmen_lasers import Laser, laser_of
from slamreplay.ingest.text_logs.carmen_lines import CarmenLines, read_lines
from slamreplay.ingest.text_logs.lines import read_text
from slamreplay.ingest.text_logs.log import TextLog
from slamreplay.ingest.text_logs.rows import odometry_rows, reference_rows, static_rows

#: With fewer ODOM lines per line of a laser these are no stream to dead-reckon with.
_SPARSE = 0.1


def read_carmen(path: Path, robot: str | None) -> TextLog:
    """A CARMEN log; frames odom, base_link, laser, rear_laser, laser_3 and so on.

    Args:
        path: plain text, gzip or bzip2.
        robot: must be None, for such a log has one robot.

    Raises:
        UsageError: a robot was asked for.
        LogError: the file cannot be read.
    """
    if robot is not None:
        raise UsageError("a CARMEN log holds one robot", where="--robot", hint="leave it out")
    text = read_text(path, "carmen")
    said = read_lines(text.lines, path.name)
    lasers = [
        laser_of(groups, said.params, path.name)
        for keyword, groups in sorted(said.groups.items())
        if keyword.endswith("LASER") or keyword[-1].isdigit()
    ]
    lasers = [laser for laser in lasers if len(laser.t_log_ns)]
    odometry, losses = _odometry(said, lasers, path.name)
    topics = [*odometry, *(_scans(laser) for laser in lasers), *_truth(said)]
    topics = [_without_zero_stamps(topic) for topic in topics]
    mounts = {}
    for laser in lasers:
        if laser.mount_xyyaw is not None:
            by_lines = bool(np.isfinite(laser.robot_xyyaw).any())
            if by_lines or laser.frame not in mounts:
                mounts[laser.frame] = laser.mount_xyyaw
    if mounts:
        first = min(int(topic.t_log_ns[0]) for topic in topics)
        frames = sorted(mounts)
        poses = np.array([mounts[frame] for frame in frames])
        topics.append(static_rows("base_link", frames, poses, "carmen", first))
    losses += [loss for laser in lasers for loss in laser.losses]
    return TextLog((text.source,), topics, [*text.losses, *said.losses, *losses])


def _odometry(
    said: CarmenLines, lasers: Sequence[Laser], file: str
) -> tuple[list[TopicRows], list[Loss]]:
    """From ODOM lines, else from the laser with most poses on its lines."""
    groups = said.groups.get("ODOM", [])
    fields = np.concatenate([np.empty((0, 6)), *(g.fields for g in groups)])
    told = [laser for laser in lasers if np.isfinite(laser.robot_xyyaw).all(axis=1).any()]
    losses = []
    if told and len(fields) < _SPARSE * max(len(laser.t_log_ns) for laser in told):
        laser = max(told, key=lambda one: len(one.t_log_ns))
        xyyaw, velocity = laser.robot_xyyaw, laser.velocity
        name, times = f"{laser.name} odometry", (laser.t_sensor_ns, laser.t_log_ns)
        if len(fields):
            reason = f"too few beside the odometry on {laser.name} lines"
            losses.append(
                Loss(kind="skipped", what=f"{file}: ODOM", count=len(fields), reason=reason)
            )
    elif groups:
        name, (group,) = "ODOM", groups
        xyyaw, velocity = fields[:, :3], fields[:, 3:5]
        times = (group.t_sensor_ns, group.t_log_ns)
        reason = "left out beside the ODOM lines: it may be an older one"
        losses = [
            Loss(kind="skipped", what=f"{file}: odometry on {laser.name} lines",
                 count=len(laser.t_log_ns), reason=reason)
            for laser in told
        ]  # fmt: skip
    else:
        return [], []
    sound = np.isfinite(xyyaw).all(axis=1)
    if not sound.all():
        count, reason = int((~sound).sum()), "pose is not finite"
        losses.append(Loss(kind="lost", what=f"{file}: {name}", count=count, reason=reason))
    xyyaw, velocity = xyyaw[sound], velocity[sound]
    moves = len(xyyaw) > 1 and bool((np.ptp(xyyaw, axis=0) > 0.0).any())
    if moves and not np.nan_to_num(velocity).any():
        velocity = np.full_like(velocity, np.nan)
        reason = "velocities are all zero while the robot moves: taken as not recorded"
        losses.append(
            Loss(kind="repaired", what=f"{file}: {name}", count=len(velocity), reason=reason)
        )
    rows = odometry_rows(name, f"carmen/{name.split()[0]}", xyyaw, velocity,
                         times[0][sound], times[1][sound])  # fmt: skip
    return ([rows] if len(rows) else []), losses


def _scans(laser: Laser) -> TopicRows:
    n = len(laser.t_log_ns)
    kind = f"carmen/{laser.name}"
    return TopicRows(laser.name, kind, n, "scans", laser.scans, laser.t_sensor_ns, laser.t_log_ns)


def _truth(said: CarmenLines) -> list[TopicRows]:
    """TRUEPOS, the simulator's truth."""
    return [
        reference_rows("TRUEPOS", "carmen/TRUEPOS", "simulation", group.fields[sound, :3],
                       group.t_sensor_ns[sound], group.t_log_ns[sound])
        for group in said.groups.get("TRUEPOS", [])
        if (sound := np.isfinite(group.fields[:, :3]).all(axis=1)).any()
    ]  # fmt: skip


def _without_zero_stamps(topic: TopicRows) -> TopicRows:
    """Ipc times that are zero throughout are none."""
    if topic.t_sensor_ns.any():
        return topic
    return replace(topic, t_sensor_ns=np.full(len(topic), NO_STAMP))
