"""States of batteries in the table `health`, and when charging began."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.view import BundleView

#: BatteryState.power_supply_status, in its own order.
STATES = ("unknown", "charging", "discharging", "not charging", "full")
#: States before charging that say it had not begun; a full battery is topped up where it stands.
_BEFORE = ("unknown", "discharging", "not charging")


def charging_stretches(view: BundleView) -> NDArray[np.int64]:
    """(N, 2) from when to when a battery was being charged, sorted, ns.

    Only where the state before was told and was another one; the last stretch may end with the log.
    """
    table = view.table("health")
    told = np.isin(table["message"].astype(str), STATES)
    topics, names = table["topic"].astype(str), table["name"].astype(str)
    found = []
    for topic in sorted(set(topics[told])):
        if not told[topics == topic].all():
            continue  # a log line may well say "charging"
        for name in sorted(set(names[topics == topic])):
            rows = np.flatnonzero((topics == topic) & (names == name))
            rows = rows[np.argsort(table.t_ns[rows], kind="stable")]
            state, t_ns = table["message"][rows].astype(str), table.t_ns[rows]
            ends = np.append(t_ns[1:], view.manifest.end_ns)
            begins = (state[1:] == "charging") & np.isin(state[:-1], _BEFORE)
            at = np.flatnonzero(begins) + 1
            found.append(np.column_stack([t_ns[at], ends[at]]))
    if not found:
        return np.empty((0, 2), dtype=np.int64)
    return np.unique(np.concatenate(found), axis=0)
