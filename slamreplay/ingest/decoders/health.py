"""diagnostic_msgs/DiagnosticArray, and the log lines of ROS 1 and ROS 2."""

from __future__ import annotations

from typing import Any

import numpy as np

from slamreplay.geometry.times import Times
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages


def _diagnostics(messages: Messages) -> Decoded:
    states, rows = messages.children("status")
    columns = {
        "level": np.array([_number(v) for v in states.column("level", object)], dtype=np.int32),
        "name": states.texts("name"),
        "message": states.texts("message"),
    }
    return Decoded(columns, rows, messages.stamps()[rows])


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
LOG = Decoder("health", _log)
