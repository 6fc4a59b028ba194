"""nav2_msgs/BehaviorTreeLog, with and without `uid`: recoveries by the names of their nodes."""

from __future__ import annotations

import numpy as np

from slamreplay.ingest.action_names import is_recovery
from slamreplay.ingest.decoders.checks import kept
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark
from slamreplay.ingest.decoders.recovery_rows import recovery_columns


def _decode(messages: Messages) -> Decoded:
    events, rows = messages.children("event_log")
    names = events.texts("node_name")
    keep = np.array([is_recovery(name) for name in names], dtype=bool)
    before, after = (
        np.array([s.lower() for s in events.texts(f"{which}_status")], dtype=object)
        for which in ("previous", "current")
    )
    # A node that is done within one tick is never seen running; it ran all the same.
    at_once = (before == "idle") & ((after == "success") | (after == "failure"))
    times = 1 + at_once.astype(np.int64)
    event = np.repeat(np.arange(len(events)), times)
    began = np.append(event[:-1] == event[1:], False)[: len(event)]
    status = np.where(began, "running", after[event]).astype(object)
    columns = recovery_columns(names[event], status, "", "behavior_tree", len(event))
    # Events are stamped with wall time even in simulation; the log's own stamp is the robot's time.
    stamps = messages.stamps("timestamp")[rows]
    remarks = (Remark("skipped", int((~keep).sum()), "events of nodes that are no recovery"),)
    return kept(keep[event], columns, rows[event], stamps[event], remarks)


BEHAVIOR_TREE_LOG = Decoder("recoveries", _decode)
