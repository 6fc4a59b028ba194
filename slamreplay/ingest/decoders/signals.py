"""Single numbers a localizer says of itself: emcl2, als_ros, Autoware's NDT, and plain floats.

What a number means stands in its topic's name, so the name goes into the row.
"""

from __future__ import annotations

import numpy as np

from slamreplay.geometry.times import NO_STAMP, Times
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark

#: What als_ros puts into a vector (MCL.h, MRFFailureDetector.h): names of x, y, z in use.
_VECTORS = {
    "reliability": ("reliability", "mean_absolute_error", "mean_absolute_error_threshold"),
    "failure_probability": ("failure_probability",),
}
#: als_ros publishes this probability where it had too few residuals to tell.
_UNTOLD = -1.0


def _decode(messages: Messages, t_sensor_ns: Times) -> Decoded:
    name = messages.topic.rpartition("/")[2]
    columns = {
        "name": np.full(len(messages), name, dtype=object),
        "value": messages.column("data"),
    }
    return Decoded(columns, messages.every, t_sensor_ns)


def _plain(messages: Messages) -> Decoded:
    return _decode(messages, np.full(len(messages), NO_STAMP))


def _stamped(messages: Messages) -> Decoded:
    return _decode(messages, messages.stamps("stamp"))


def _vector(messages: Messages) -> Decoded:
    names = _VECTORS.get(messages.topic.rpartition("/")[2].lower(), ("x", "y", "z"))
    values = messages.columns("vector", "xyz")[:, : len(names)]
    told = np.ones(len(messages), dtype=bool)
    if names == _VECTORS["failure_probability"]:
        told = values[:, 0] != _UNTOLD
    rows = np.repeat(messages.every[told], len(names))
    columns = {
        "name": np.tile(np.array(names, dtype=object), int(told.sum())),
        "value": values[told].ravel(),
    }
    untold = Remark("skipped", int((~told).sum()), "told as -1: too few beams to judge")
    return Decoded(columns, rows, messages.stamps()[rows], (untold,))


NUMBER = Decoder("signals", _plain)
NUMBER_STAMPED = Decoder("signals", _stamped)
VECTOR_STAMPED = Decoder("signals", _vector)
