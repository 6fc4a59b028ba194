"""geometry_msgs/Twist and TwistStamped."""

from __future__ import annotations

import numpy as np

from slamreplay.geometry.times import NO_STAMP, Times
from slamreplay.ingest.decoders.checks import kept
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark


def _decode(messages: Messages, path: str, t_sensor_ns: Times) -> Decoded:
    columns = {
        "linear_velocity_xyz": messages.columns(f"{path}linear", "xyz"),
        "angular_velocity_xyz": messages.columns(f"{path}angular", "xyz"),
    }
    keep = np.asarray(np.isfinite(np.column_stack(list(columns.values()))).all(axis=1))
    remarks = (Remark("lost", int((~keep).sum()), "velocity is not finite"),)
    return kept(keep, columns, messages.every, t_sensor_ns, remarks)


def _twist(messages: Messages) -> Decoded:
    return _decode(messages, "", np.full(len(messages), NO_STAMP))


def _twist_stamped(messages: Messages) -> Decoded:
    return _decode(messages, "twist.", messages.stamps())


TWIST = Decoder("commands", _twist)
TWIST_STAMPED = Decoder("commands", _twist_stamped)
