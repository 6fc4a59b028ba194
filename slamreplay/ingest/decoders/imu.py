"""sensor_msgs/Imu: a covariance that starts with -1 says that the quantity is not measured."""

from __future__ import annotations

import numpy as np

from slamreplay.geometry import se3
from slamreplay.ingest.decoders.checks import slashed
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark


def _decode(messages: Messages) -> Decoded:
    covariances, values = {}, {}
    for name, letters in (
        ("orientation", "xyzw"),
        ("angular_velocity", "xyz"),
        ("linear_acceleration", "xyz"),
    ):
        value = messages.columns(name, letters)
        covariance = messages.fixed(f"{name}_covariance", 9)
        absent = covariance[:, 0] == -1.0
        value[absent], covariance[absent] = np.nan, np.nan
        values[name], covariances[name] = value, covariance
    raw = values["orientation"]
    unit, sound = se3.unit_quaternion(raw)
    given = np.isfinite(raw).all(axis=1)
    turned = np.isfinite(unit).all(axis=1)
    covariances["orientation"][given & ~turned] = np.nan
    remarks = (
        Remark("repaired", int((turned & ~sound).sum()), "quaternion normalised"),
        Remark("repaired", int((given & ~turned).sum()), "zero quaternion taken as not measured"),
        slashed(messages.texts("header.frame_id")),
    )
    columns = {
        "frame_id": messages.frames(),
        "orientation_xyzw": unit,
        "orientation_covariance": covariances["orientation"],
        "angular_velocity_xyz": values["angular_velocity"],
        "angular_velocity_covariance": covariances["angular_velocity"],
        "linear_acceleration_xyz": values["linear_acceleration"],
        "linear_acceleration_covariance": covariances["linear_acceleration"],
    }
    return Decoded(columns, messages.every, messages.stamps(), remarks)


IMU = Decoder("imu", _decode)
