"""move_base_msgs/RecoveryStatus: published when ROS 1's move_base starts a recovery."""

from __future__ import annotations

from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages
from slamreplay.ingest.decoders.recovery_rows import recovery_columns


def _decode(messages: Messages) -> Decoded:
    name = messages.texts("recovery_behavior_name")
    columns = recovery_columns(name, "running", "", "recovery_status", len(messages))
    return Decoded(columns, messages.every, messages.stamps("pose_stamped.header.stamp"))


RECOVERY_STATUS = Decoder("recoveries", _decode)
