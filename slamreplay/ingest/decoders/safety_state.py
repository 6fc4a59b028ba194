"""Nav2's collision monitor, collision detector and speed limits, as they change.

They are health: a device that takes the speed away is what an engineer looks for when a robot
stood still, and it is nothing the navigator did to get free.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry.times import NO_STAMP
from slamreplay.ingest.decoders.checks import kept
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark

#: nav2_msgs/CollisionMonitorState.action_type in words.
_ACTIONS = ("released", "stop", "slowdown", "approach", "limit")


def _monitor(messages: Messages) -> Decoded:
    action = messages.column("action_type", np.int64)
    words = np.array([*_ACTIONS, "unknown action"], dtype=object)
    word = words[np.where((action >= 0) & (action < len(_ACTIONS)), action, len(_ACTIONS))]
    texts = [
        f"collision monitor: {w}{f' by polygon {p}' if p else ''}"
        for w, p in zip(word, messages.texts("polygon_name"), strict=True)
    ]
    return _changes(messages, "collision_monitor", action, texts)


def _detector(messages: Messages) -> Decoded:
    polygons, rows = messages.children("polygons")
    names = polygons.texts("")
    seen = messages.ragged("detections", bool)
    # The nth polygon is the one of the nth detection; one without a detection was not looked at.
    nth = np.arange(len(rows)) - np.searchsorted(rows, rows)
    looked = nth < seen.lengths[rows]
    is_hit = np.zeros(len(rows), dtype=bool)
    is_hit[looked] = seen.values[(seen.offsets[rows] + nth)[looked]]
    hit: list[list[str]] = [[] for _ in range(len(messages))]
    for row in np.flatnonzero(is_hit):
        hit[rows[row]].append(str(names[row]))
    texts = [f"collision detector: points in {', '.join(p) or 'no polygon'}" for p in hit]
    return _changes(messages, "collision_detector", np.array([len(p) for p in hit]), texts)


def _speed_limit(messages: Messages) -> Decoded:
    limit = messages.column("speed_limit")
    percent = messages.column("percentage", bool)
    texts = [
        "speed limit: none" if v == 0.0 else f"speed limit: {v:g} {'%' if p else 'm/s'}"
        for v, p in zip(limit, percent, strict=True)
    ]
    known = np.isfinite(limit)
    remarks = (Remark("lost", int((~known).sum()), "speed limit is not finite"),)
    return _changes(messages, "speed_limit", np.zeros(len(messages)), texts, known, remarks)


def _changes(
    messages: Messages,
    name: str,
    level: NDArray[Any],
    texts: list[str],
    known: NDArray[np.bool_] | None = None,
    remarks: tuple[Remark, ...] = (),
) -> Decoded:
    """Rows of messages that say something other than the one before."""
    message = np.empty(len(messages), dtype=object)
    message[:] = texts
    new = np.append(True, message[1:] != message[:-1])[: len(messages)]
    columns = {
        "level": level.astype(np.int32),
        "name": np.full(len(messages), name, dtype=object),
        "message": message,
    }
    keep = new if known is None else new & known
    stamped = messages.has("header.stamp")
    stamps = messages.stamps() if stamped else np.full(len(messages), NO_STAMP)
    return kept(np.asarray(keep, dtype=bool), columns, messages.every, stamps, remarks)


COLLISION_MONITOR = Decoder("health", _monitor)
COLLISION_DETECTOR = Decoder("health", _detector)
SPEED_LIMIT = Decoder("health", _speed_limit)
