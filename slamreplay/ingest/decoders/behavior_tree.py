"""nav2_msgs/BehaviorTreeLog, with and without `uid`: recoveries by the names of their nodes."""

from __future__ import annotations

import re

import numpy as np

from slamreplay.ingest.decoders.checks import kept
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark

#: Node names are whatever the tree's XML says, so known stems are looked for inside them.
_RECOVERY = re.compile(
    r"spin|back_?up|wait|drive_?on_?heading|assisted_?teleop|clear.*costmap|clearing|recover",
    re.IGNORECASE,
)


def _decode(messages: Messages) -> Decoded:
    events, rows = messages.children("event_log")
    names = events.texts("node_name")
    keep = np.array([bool(_RECOVERY.search(name)) for name in names], dtype=bool)
    status = events.texts("current_status")
    columns = {
        "name": names,
        "status": np.array([s.lower() for s in status], dtype=object),
        "source": np.full(len(events), "behavior_tree", dtype=object),
    }
    # Events are stamped with wall time even in simulation; the log's own stamp is the robot's time.
    stamps = messages.stamps("timestamp")[rows]
    remarks = (Remark("skipped", int((~keep).sum()), "events of nodes that are no recovery"),)
    return kept(keep, columns, rows, stamps, remarks)


BEHAVIOR_TREE_LOG = Decoder("recoveries", _decode)
