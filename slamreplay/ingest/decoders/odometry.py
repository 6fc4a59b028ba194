"""nav_msgs/Odometry."""

from __future__ import annotations

from slamreplay.ingest.decoders.checks import kept, pose_rows, slashed
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages


def _decode(messages: Messages) -> Decoded:
    position = messages.columns("pose.pose.position", "xyz")
    orientation, keep, remarks = pose_rows(
        position, messages.columns("pose.pose.orientation", "xyzw")
    )
    columns = {
        "frame_id": messages.frames(),
        "child_frame_id": messages.frames("child_frame_id"),
        "position_xyz": position,
        "orientation_xyzw": orientation,
        "pose_covariance": messages.fixed("pose.covariance", 36),
        "linear_velocity_xyz": messages.columns("twist.twist.linear", "xyz"),
        "angular_velocity_xyz": messages.columns("twist.twist.angular", "xyz"),
        "twist_covariance": messages.fixed("twist.covariance", 36),
    }
    slashes = slashed(messages.texts("header.frame_id"), messages.texts("child_frame_id"))
    return kept(keep, columns, messages.every, messages.stamps(), (*remarks, slashes))


ODOMETRY = Decoder("odometry", _decode)
