"""sensor_msgs/JointState: one row a joint; what a message does not tell is not a number."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Ragged
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark


def _decode(messages: Messages) -> Decoded:
    names = messages.ragged("name", object)
    rows = np.repeat(messages.every, names.lengths)
    place = np.arange(len(rows)) - names.offsets[:-1][rows]
    columns: dict[str, Any] = {"name": names.values}
    fits = np.ones(len(messages), dtype=bool)
    for field in ("position", "velocity", "effort"):
        told = messages.ragged(field, np.float64)
        columns[field] = _of_each(told, rows, place)
        fits &= (told.lengths == names.lengths) | (told.lengths == 0)
    odd = Remark("repaired", int((~fits).sum()), "values do not fit the joints' names in number")
    return Decoded(columns, rows, messages.stamps()[rows], (odd,))


def _of_each(
    told: Ragged, rows: NDArray[np.int64], place: NDArray[np.int64]
) -> NDArray[np.float64]:
    """The value at `place` (M,) of the list of message `rows` (M,), NaN where it is shorter."""
    there = place < told.lengths[rows]
    values = np.full(len(rows), np.nan)
    values[there] = told.values[told.offsets[:-1][rows[there]] + place[there]]
    return values


JOINT_STATE = Decoder("joints", _decode)
