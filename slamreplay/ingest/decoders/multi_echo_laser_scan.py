"""sensor_msgs/MultiEchoLaserScan: the first echo of each beam, as a scan.

The message says nothing of the order of echoes; ROS' own laser_proc takes them to come in the order
received, the nearest first, and calls a beam without any not a number. So does this.
"""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.tables import Ragged
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark
from slamreplay.ingest.decoders.laser_scan import scan_rows


def _decode(messages: Messages) -> Decoded:
    beams, rows = messages.children("ranges")
    echoes = beams.ragged("echoes", np.float32)
    heard = echoes.lengths > 0
    first = np.full(len(beams), np.nan, dtype=np.float32)
    first[heard] = echoes.values[echoes.offsets[:-1][heard]]
    counts = np.bincount(rows, minlength=len(messages))
    ranges = Ragged(first, np.concatenate([[0], np.cumsum(counts)]).astype(np.int64))
    further = len(echoes.values) - int(heard.sum())
    return scan_rows(messages, ranges, (Remark("skipped", further, "further echoes of a beam"),))


MULTI_ECHO_LASER_SCAN = Decoder("scans", _decode)
