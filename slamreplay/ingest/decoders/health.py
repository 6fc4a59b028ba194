"""diagnostic_msgs/DiagnosticArray and DiagnosticStatus, and the log lines of ROS 1 and ROS 2."""

from __future__ import annotations

from typing import Any

import numpy as np

from slamreplay.geometry.times import NO_STAMP, Times
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages

#: Level of rows whose message type has none: info, as rcl_interfaces/Log counts.
INFO = 20


def _diagnostics(messages: Messages) -> Decoded:
    states, rows = messages.children("status")
    return Decoded(_status(states), rows, messages.stamps()[rows])


def _single(messages: Messages) -> Decoded:
    return Decoded(_status(messages), messages.every, np.full(len(messages), NO_STAMP))


def _status(states: Messages) -> dict[str, Any]:
    return {
        "level": np.array([_number(v) for v in states.column("level", object)], dtype=np.int32),
        "name": states.texts("name"),
        "message": states.texts("message"),
    }


def _log(messages: Messages) -> Decoded:
    columns = {
        "level": np.array([_number(v) for v in messages.column("level", object)], dtype=np.int32),
        "name": messages.texts("name"),
        "message": messages.texts("msg"),
    }
    stamps: Times = messages.stamps("header.stamp" if messages.has("header") else "stamp")
    return Decoded(columns, messages.every, stamps)


def _number(level: Any) -> int:
    """ROS 2 declares the level of a diagnostic as `byte`, which arrives as bytes of length 1."""
    return int(level[0] if isinstance(level, bytes) else level)


DIAGNOSTICS = Decoder("health", _diagnostics)
DIAGNOSTIC_STATUS = Decoder("health", _single)
LOG = Decoder("health", _log)
