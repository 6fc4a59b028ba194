"""sensor_msgs/NavSatFix: where the antenna was on the earth, in metres.

Rows are in REP-105's frame `earth` (earth-centred, earth-fixed), so that no message needs another
one for a datum; `child_frame_id` is the antenna's frame.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry.geodesy import earth_from_geodetic, enu_axes
from slamreplay.geometry.times import Times
from slamreplay.ingest.decoders.checks import kept
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark

#: NavSatFix: position_covariance_type 0 is unknown; NavSatStatus: -1 is no fix.
_UNKNOWN, _NO_FIX = 0, -1


def _decode(messages: Messages) -> Decoded:
    fixed = messages.column("status.status", np.int64) > _NO_FIX
    return fix_rows(messages, fixed, messages.frames(), messages.stamps())


def fix_rows(
    messages: Messages, fixed: NDArray[np.bool_], frames: NDArray[Any], t_sensor_ns: Times
) -> Decoded:
    """Rows of table references from messages with NavSatFix's fields of place and covariance.

    Args:
        messages: N messages with latitude, longitude (degrees), altitude (m), position_covariance
            (east, north, up, m^2) and position_covariance_type.
        fixed: (N,) whether the receiver had a fix.
        frames: (N,) the antenna's frame.
        t_sensor_ns: (N,) stamps.
    """
    place = np.column_stack(
        [messages.column(name) for name in ("latitude", "longitude", "altitude")]
    ).reshape(-1, 3)
    place[:, 2] = np.where(np.isfinite(place[:, 2]), place[:, 2], 0.0)  # receivers may lack it
    finite = np.isfinite(place).all(axis=1)
    sound = finite & (np.abs(place[:, 0]) <= 90.0) & (np.abs(place[:, 1]) <= 180.0)
    # Not a number passes through sines and products in silence; an infinity would warn.
    place[~sound] = np.nan
    axes = enu_axes(place[:, 0], place[:, 1])
    enu = messages.fixed("position_covariance", 9).reshape(-1, 3, 3)
    enu = np.where(np.isfinite(enu), enu, np.nan)
    covariance = np.full((len(messages), 6, 6), np.nan)
    covariance[:, :3, :3] = np.swapaxes(axes, 1, 2) @ enu @ axes
    covariance[messages.column("position_covariance_type", np.int64) == _UNKNOWN] = np.nan
    columns: dict[str, Any] = {
        "frame_id": np.full(len(messages), "earth", dtype=object),
        "child_frame_id": frames,
        "kind": np.full(len(messages), "gnss", dtype=object),
        "position_xyz": earth_from_geodetic(place),
        "orientation_xyzw": np.tile([0.0, 0.0, 0.0, 1.0], (len(messages), 1)),
        "covariance": covariance.reshape(-1, 36),
    }
    remarks = (
        Remark("lost", int((~sound).sum()), "latitude or longitude is none"),
        Remark("skipped", int((sound & ~fixed).sum()), "the receiver had no fix"),
    )
    return kept(sound & fixed, columns, messages.every, t_sensor_ns, remarks)


NAV_SAT_FIX = Decoder("references", _decode)
