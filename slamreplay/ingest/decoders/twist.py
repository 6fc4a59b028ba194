"""geometry_msgs/Twist, TwistStamped and TwistWithCovarianceStamped.

A plain twist is a command. A stamped one is a measurement unless its topic is named as a command:
Nav2 and ros2_control stamp commands too.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry.times import NO_STAMP, Times
from slamreplay.ingest.decoders.checks import kept
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark


def _velocities(messages: Messages, path: str) -> dict[str, NDArray[np.float64]]:
    return {
        "linear_velocity_xyz": messages.columns(f"{path}linear", "xyz"),
        "angular_velocity_xyz": messages.columns(f"{path}angular", "xyz"),
    }


def _decode(
    messages: Messages,
    velocities: dict[str, NDArray[np.float64]],
    more: dict[str, NDArray],
    t_sensor_ns: Times,
) -> Decoded:
    keep = np.asarray(np.isfinite(np.column_stack(list(velocities.values()))).all(axis=1))
    remarks = (Remark("lost", int((~keep).sum()), "velocity is not finite"),)
    return kept(keep, {**velocities, **more}, messages.every, t_sensor_ns, remarks)


def _twist(messages: Messages) -> Decoded:
    return _decode(messages, _velocities(messages, ""), {}, np.full(len(messages), NO_STAMP))


def _stamped(messages: Messages) -> Decoded:
    more = {"frame_id": messages.frames(), "twist_covariance": np.full((len(messages), 36), np.nan)}
    return _decode(messages, _velocities(messages, "twist."), more, messages.stamps())


def _with_covariance(messages: Messages) -> Decoded:
    more = {
        "frame_id": messages.frames(),
        "twist_covariance": messages.fixed("twist.covariance", 36),
    }
    return _decode(messages, _velocities(messages, "twist.twist."), more, messages.stamps())


TWIST = Decoder("commands", _twist)
TWIST_STAMPED = Decoder("velocities", _stamped)
TWIST_WITH_COVARIANCE = Decoder("velocities", _with_covariance)
