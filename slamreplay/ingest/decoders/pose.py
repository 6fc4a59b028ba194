"""geometry_msgs/PoseWithCovarianceStamped and PoseStamped."""

from __future__ import annotations

import numpy as np

from slamreplay.ingest.decoders.checks import kept, pose_rows, slashed
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages


def _decode(messages: Messages, path: str, covariance: np.ndarray) -> Decoded:
    position = messages.columns(f"{path}.position", "xyz")
    orientation, keep, remarks = pose_rows(
        position, messages.columns(f"{path}.orientation", "xyzw")
    )
    empty = np.full(len(messages), "", dtype=object)
    columns = {
        "frame_id": messages.frames(),
        "child_frame_id": empty,  # the message names none: it is the robot's base
        "source": np.full(len(messages), "topic", dtype=object),
        "position_xyz": position,
        "orientation_xyzw": orientation,
        "covariance": covariance,
    }
    slashes = slashed(messages.texts("header.frame_id"))
    return kept(keep, columns, messages.every, messages.stamps(), (*remarks, slashes))


def _with_covariance(messages: Messages) -> Decoded:
    return _decode(messages, "pose.pose", messages.fixed("pose.covariance", 36))


def _without(messages: Messages) -> Decoded:
    return _decode(messages, "pose", np.full((len(messages), 36), np.nan))


POSE_WITH_COVARIANCE = Decoder("poses", _with_covariance)
POSE = Decoder("poses", _without)
