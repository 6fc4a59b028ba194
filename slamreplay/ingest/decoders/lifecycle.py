"""lifecycle_msgs/TransitionEvent: a node of ROS 2 went from one state to another."""

from __future__ import annotations

import numpy as np

from slamreplay.geometry.times import NO_STAMP
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages
from slamreplay.ingest.decoders.health import INFO


def _decode(messages: Messages) -> Decoded:
    node = messages.topic.rpartition("/")[0]  # of /amcl/transition_event
    start, goal = messages.texts("start_state.label"), messages.texts("goal_state.label")
    columns = {
        "level": np.full(len(messages), INFO, dtype=np.int32),
        "name": np.full(len(messages), node, dtype=object),
        "message": start + " -> " + goal,
    }
    # The message has a timestamp, and rcl_lifecycle never fills it.
    return Decoded(columns, messages.every, np.full(len(messages), NO_STAMP))


TRANSITION_EVENT = Decoder("health", _decode)
