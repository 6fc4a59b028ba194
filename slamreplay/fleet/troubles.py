"""When a log's trouble begins: where to open it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from slamreplay.fleet.counted import CHANGED, LOST, Counted
from slamreplay.geometry.times import NS_PER_S

if TYPE_CHECKING:
    from slamreplay.fleet.snapshot import Snapshot


def troubles_s(now: Snapshot, logs: Counted) -> dict[str, float]:
    """By key, seconds from the start to the first interval of a lost robot or a changed map."""
    import pyarrow as pa
    import pyarrow.compute as pc

    start = dict(zip(logs.texts["key"].tolist(), logs.start_ns.tolist(), strict=True))
    first: dict[str, int] = {}
    states = pa.array(sorted({*LOST, *CHANGED}))
    for table in now.tables("intervals", ("key", "state", "start_ns")):
        odd = table.filter(pc.is_in(table["state"], value_set=states))
        for key, start_ns in zip(odd["key"].to_pylist(), odd["start_ns"].to_pylist(), strict=True):
            if key in start:
                first[key] = min(start_ns, first.get(key, start_ns))
    return {key: (first[key] - start[key]) / NS_PER_S for key in sorted(first)}
