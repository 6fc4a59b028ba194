"""sensor_msgs/MagneticField: axes that a sensor does not have are NaN, as the message asks for."""

from __future__ import annotations

import numpy as np

from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages


def _decode(messages: Messages) -> Decoded:
    covariance = messages.fixed("magnetic_field_covariance", 9)
    covariance[(covariance == 0.0).all(axis=1)] = np.nan  # "0 is interpreted as variance unknown"
    columns = {
        "frame_id": messages.frames(),
        "magnetic_field_xyz": messages.columns("magnetic_field", "xyz"),
        "magnetic_field_covariance": covariance,
    }
    return Decoded(columns, messages.every, messages.stamps())


MAGNETIC_FIELD = Decoder("magnetic_fields", _decode)
