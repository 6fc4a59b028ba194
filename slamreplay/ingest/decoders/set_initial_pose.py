"""Calls of nav2_msgs/SetInitialPose, as service introspection records them."""

from __future__ import annotations

import numpy as np

from slamreplay.ingest.decoders.checks import kept, pose_rows
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark

#: service_msgs/ServiceEventInfo.
_REQUEST_SENT, _REQUEST_RECEIVED = 0, 1


def _decode(messages: Messages) -> Decoded:
    requests, rows = messages.children("request")
    event = messages.column("info.event_type", np.int64)[rows]
    # Caller and server may both be introspected: what was received is what counts.
    twice = (event == _REQUEST_SENT) & (event == _REQUEST_RECEIVED).any()
    position = requests.columns("pose.pose.pose.position", "xyz")
    orientation, keep, remarks = pose_rows(
        position, requests.columns("pose.pose.pose.orientation", "xyzw")
    )
    columns = {
        "frame_id": requests.frames("pose.header.frame_id"),
        "position_xyz": position,
        "orientation_xyzw": orientation,
        "covariance": requests.fixed("pose.pose.covariance", 36),
    }
    empty = len(messages) - len(np.unique(rows))
    own = (
        Remark("skipped", int(twice.sum()), "requests that their receiver told too"),
        Remark("skipped", empty, "answers, or requests without their content"),
    )
    stamps = messages.stamps("info.stamp")[rows]
    return kept(keep & ~twice, columns, rows, stamps, (*remarks, *own))


SET_INITIAL_POSE = Decoder("initial_poses", _decode)
