"""rosgraph_msgs/Clock: the time that was told to every node, beside when it was recorded."""

from __future__ import annotations

import numpy as np

from slamreplay.geometry.times import NO_STAMP, stamp_ns
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages


def _decode(messages: Messages) -> Decoded:
    told = stamp_ns(
        messages.column("clock.sec", np.int64), messages.column("clock.nanosec", np.int64)
    )
    # What it tells is the question, so it is no stamp that the row could be placed by.
    return Decoded({"clock_ns": told}, messages.every, np.full(len(messages), NO_STAMP))


CLOCK = Decoder("clock", _decode)
