"""sensor_msgs/LaserScan: ranges stay as recorded, for +inf, NaN and 0 mean different things."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import ODD_ANGLES
from slamreplay.bundle.tables import Ragged
from slamreplay.ingest.decoders.checks import kept, slashed
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark

#: So many beams between two ideas of the last one are more than a way of counting.
_BEAMS_OFF = 2.5


def scan_rows(messages: Messages, ranges: Ragged, remarks: tuple[Remark, ...] = ()) -> Decoded:
    """Rows of table scans: one range a beam, and the fields that every laser scan has."""
    columns: dict[str, Any] = {
        "frame_id": messages.frames(),
        "angle_min_rad": messages.column("angle_min"),
        "angle_increment_rad": messages.column("angle_increment"),
        "time_increment_s": messages.column("time_increment"),
        "scan_time_s": messages.column("scan_time"),
        "range_min_m": messages.column("range_min"),
        "range_max_m": messages.column("range_max"),
        "ranges_m": ranges,
    }
    finite = np.ones(len(messages), dtype=bool)
    for name in ("angle_min_rad", "angle_increment_rad", "range_min_m"):
        finite &= np.isfinite(columns[name])
    finite &= ~np.isnan(columns["range_max_m"])
    moving = (columns["angle_increment_rad"] != 0.0) | (ranges.lengths <= 1)
    odd = finite & moving & _odd(messages, columns, ranges)
    own = (
        Remark("lost", int((~finite).sum()), "angles or range limits are not finite"),
        Remark("lost", int((finite & ~moving).sum()), "angle increment is zero"),
        Remark("repaired", int(odd.sum()), ODD_ANGLES),
        slashed(messages.texts("header.frame_id")),
    )
    return kept(finite & moving, columns, messages.every, messages.stamps(), (*remarks, *own))


def _decode(messages: Messages) -> Decoded:
    return scan_rows(messages, messages.ragged("ranges", np.float32))


def _odd(messages: Messages, columns: dict[str, Any], ranges: Ragged) -> NDArray[np.bool_]:
    """(N,) scans whose last beam is not where angle_max has it.

    Drivers differ by one beam in what they call the last one, so that is nothing odd; nor is a
    zero, which nobody filled in.
    """
    told, step = messages.column("angle_max"), columns["angle_increment_rad"]
    with np.errstate(invalid="ignore"):  # an endless step
        last = columns["angle_min_rad"] + step * np.maximum(ranges.lengths - 1, 0)
        return np.asarray((told != 0.0) & (np.abs(told - last) > _BEAMS_OFF * np.abs(step)))


LASER_SCAN = Decoder("scans", _decode)
