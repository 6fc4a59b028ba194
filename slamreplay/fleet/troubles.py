"""Logs that could not be judged, and when the trouble of the others begins."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from slamreplay.fleet.answers import Failure
from slamreplay.fleet.counted import CHANGED, LOST, Counted
from slamreplay.geometry.times import NS_PER_S

if TYPE_CHECKING:
    from slamreplay.fleet.snapshot import Snapshot


def failures(logs: Counted) -> tuple[Failure, ...]:
    """Those that failed, by site and name, those of no site last."""
    texts = logs.texts
    found = [
        Failure(
            texts["key"][k],
            texts["log"][k] or "",
            texts["site"][k],
            texts["robot"][k],
            texts["error"][k] or "",
        )
        for k in np.flatnonzero(logs.failed).tolist()
    ]
    return tuple(sorted(found, key=lambda one: (one.site is None, one.site or "", one.log)))


def troubles_s(now: Snapshot, logs: Counted) -> dict[str, float]:
    """By key, seconds from a log's start until its first interval lost or in a changed map."""
    import pyarrow as pa
    import pyarrow.compute as pc

    start_ns = dict(zip(logs.texts["key"].tolist(), logs.start_ns.tolist(), strict=True))
    first_ns: dict[str, int] = {}
    states = pa.array(sorted({*LOST, *CHANGED}), type=pa.string())
    for table in now.tables("intervals", ("key", "state", "start_ns")):
        found = table.filter(pc.is_in(table["state"], value_set=states))
        for key, t_ns in zip(found["key"].to_pylist(), found["start_ns"].to_pylist(), strict=True):
            if key in start_ns and t_ns is not None:
                first_ns[key] = min(t_ns, first_ns.get(key, t_ns))
    return {key: (t_ns - start_ns[key]) / NS_PER_S for key, t_ns in sorted(first_ns.items())}
