"""move_base_msgs/RecoveryStatus: published when ROS 1's move_base starts a recovery."""

from __future__ import annotations

import numpy as np

from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages


def _decode(messages: Messages) -> Decoded:
    columns = {
        "name": messages.texts("recovery_behavior_name"),
        "status": np.full(len(messages), "running", dtype=object),
        "source": np.full(len(messages), "recovery_status", dtype=object),
    }
    return Decoded(columns, messages.every, messages.stamps("pose_stamped.header.stamp"))


RECOVERY_STATUS = Decoder("recoveries", _decode)
