"""Foxglove's schemas for poses, transforms, odometry, satellite fixes and log lines.

They say what their ROS siblings say, with `timestamp` and `frame_id` beside the other fields
instead of in a header. Source: docs.foxglove.dev, schemas.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from slamreplay.ingest.decoders.checks import kept, pose_rows
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark
from slamreplay.ingest.decoders.nav_sat_fix import fix_rows
from slamreplay.ingest.decoders.particles import cloud_rows
from slamreplay.ingest.decoders.path import path_rows
from slamreplay.ingest.decoders.transforms import edge_rows
from slamreplay.ingest.names import is_path


def _pose_in_frame(messages: Messages) -> Decoded:
    position = messages.columns("pose.position", "xyz")
    orientation, keep, remarks = pose_rows(position, messages.columns("pose.orientation", "xyzw"))
    columns = {
        "frame_id": messages.frames("frame_id"),
        "child_frame_id": np.full(len(messages), "", dtype=object),  # the robot's base
        "source": np.full(len(messages), "topic", dtype=object),
        "position_xyz": position,
        "orientation_xyzw": orientation,
        "covariance": np.full((len(messages), 36), np.nan),
    }
    return kept(keep, columns, messages.every, messages.stamps("timestamp"), remarks)


def _poses_in_frame(messages: Messages) -> Decoded:
    """A particle cloud, or a path where the topic is called one."""
    frames, stamps = messages.frames("frame_id"), messages.stamps("timestamp")
    if is_path(messages.topic):
        return replace(path_rows(messages, "", frames, stamps), table="plans")
    return cloud_rows(messages, "poses", "", frames, stamps, weighted=False)


def _frame_transform(messages: Messages) -> Decoded:
    return _edges(messages, messages.every)


def _frame_transforms(messages: Messages) -> Decoded:
    return _edges(*messages.children("transforms"))


def _edges(edges: Messages, rows: NDArray[np.int64]) -> Decoded:
    rotation, unset = turned(edges, "rotation")
    decoded = edge_rows(
        edges.frames("parent_frame_id"),
        edges.frames("child_frame_id"),
        edges.columns("translation", "xyz"),
        rotation,
        rows,
        edges.stamps("timestamp"),
    )
    remark = Remark("repaired", unset, "rotation left out, taken as none")
    return replace(decoded, remarks=(*decoded.remarks, remark))


def turned(messages: Messages, path: str) -> tuple[NDArray[np.float64], int]:
    """(N, 4) rotations as Foxglove draws them: those left out (all zero) turn nothing; how many."""
    rotation = messages.columns(path, "xyzw")
    unset = (rotation == 0.0).all(axis=1)
    rotation[unset] = (0.0, 0.0, 0.0, 1.0)
    return rotation, int(unset.sum())


def _odometry(messages: Messages) -> Decoded:
    position = messages.columns("pose.position", "xyz")
    orientation, keep, remarks = pose_rows(position, messages.columns("pose.orientation", "xyzw"))
    columns = {
        "frame_id": messages.frames("frame_id"),
        "child_frame_id": messages.frames("body_frame_id"),
        "position_xyz": position,
        "orientation_xyzw": orientation,
        "pose_covariance": messages.fixed("pose_covariance", 36),
        "linear_velocity_xyz": messages.columns("linear_velocity", "xyz"),
        "angular_velocity_xyz": messages.columns("angular_velocity", "xyz"),
        "twist_covariance": messages.fixed("velocity_covariance", 36),
    }
    return kept(keep, columns, messages.every, messages.stamps("timestamp"), remarks)


def _location_fix(messages: Messages) -> Decoded:
    """It has no status; off Africa, where both are zero, nothing was filled in."""
    fixed = (messages.column("latitude") != 0.0) | (messages.column("longitude") != 0.0)
    return fix_rows(messages, fixed, messages.frames("frame_id"), messages.stamps("timestamp"))


def _location_fixes(messages: Messages) -> Decoded:
    fixes, rows = messages.children("fixes")
    decoded = _location_fix(fixes)
    return replace(decoded, rows=rows[decoded.rows])


def _log(messages: Messages) -> Decoded:
    columns = {
        "level": messages.column("level", np.int32),
        "name": messages.texts("name"),
        "message": messages.texts("message"),
    }
    return Decoded(columns, messages.every, messages.stamps("timestamp"))


POSE_IN_FRAME = Decoder("poses", _pose_in_frame)
POSES_IN_FRAME = Decoder("particles", _poses_in_frame)
FRAME_TRANSFORM = Decoder("transforms", _frame_transform)
FRAME_TRANSFORMS = Decoder("transforms", _frame_transforms)
ODOMETRY = Decoder("odometry", _odometry)
LOCATION_FIX = Decoder("references", _location_fix)
LOCATION_FIXES = Decoder("references", _location_fixes)
LOG = Decoder("health", _log)
