"""sensor_msgs/LaserScan: ranges stay as recorded, for +inf, NaN and 0 mean different things."""

from __future__ import annotations

from typing import Any

import numpy as np

from slamreplay.bundle.tables import Ragged
from slamreplay.ingest.decoders.checks import kept
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark


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
    own = (
        Remark("lost", int((~finite).sum()), "angles or range limits are not finite"),
        Remark("lost", int((finite & ~moving).sum()), "angle increment is zero"),
    )
    return kept(finite & moving, columns, messages.every, messages.stamps(), (*remarks, *own))


def _decode(messages: Messages) -> Decoded:
    return scan_rows(messages, messages.ragged("ranges", np.float32))


LASER_SCAN = Decoder("scans", _decode)
