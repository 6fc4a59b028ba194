"""sensor_msgs/BatteryState: whether it was being charged, as health rows.

Rows that only repeat the state before are left out later (`slamreplay.ingest.repeats`): what stays
are the edges, and an edge to charging says that the robot stood in its dock.
"""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.batteries import STATES
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages
from slamreplay.ingest.decoders.health import INFO

#: Anything else is unknown too.
_STATES = np.array(STATES, dtype=object)
#: Many drivers leave the status unknown; Nav2 takes more than this many ampere for charging
#: (opennav_docking, simple_charging_dock.cpp).
_CHARGING_A = 0.5


def _decode(messages: Messages) -> Decoded:
    status = messages.column("power_supply_status", np.int64)
    status[(status < 0) | (status >= len(_STATES))] = 0
    current = messages.column("current")
    told = (status == 0) & np.isfinite(current)
    state = _STATES[status]
    state[told] = np.where(current[told] > _CHARGING_A, "charging", "not charging")
    location = messages.texts("location")
    columns = {
        "level": np.full(len(messages), INFO, dtype=np.int32),
        "name": np.where(location == "", "battery", location).astype(object),
        "message": state,
    }
    return Decoded(columns, messages.every, messages.stamps())


BATTERY_STATE = Decoder("health", _decode)
