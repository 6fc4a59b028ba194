"""ackermann_msgs/AckermannDrive and its stamped form: a commanded speed and steering angle."""

from __future__ import annotations

import numpy as np

from slamreplay.geometry.times import NO_STAMP, Times
from slamreplay.ingest.decoders.checks import kept
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark


def _decode(messages: Messages, path: str, t_sensor_ns: Times) -> Decoded:
    speed = messages.column(f"{path}speed")
    steering = messages.column(f"{path}steering_angle")
    linear, angular = np.zeros((2, len(messages), 3))
    linear[:, 0] = speed
    # The turn rate is speed * tan(steering) / wheelbase, and the message knows no wheelbase.
    straight = (steering == 0.0) | (speed == 0.0)
    angular[:, 2] = np.where(straight, 0.0, np.nan)
    keep = np.isfinite(speed)
    remarks = (Remark("lost", int((~keep).sum()), "velocity is not finite"),)
    columns = {"linear_velocity_xyz": linear, "angular_velocity_xyz": angular}
    return kept(keep, columns, messages.every, t_sensor_ns, remarks)


def _drive(messages: Messages) -> Decoded:
    return _decode(messages, "", np.full(len(messages), NO_STAMP))


def _drive_stamped(messages: Messages) -> Decoded:
    return _decode(messages, "drive.", messages.stamps())


ACKERMANN_DRIVE = Decoder("commands", _drive)
ACKERMANN_DRIVE_STAMPED = Decoder("commands", _drive_stamped)
