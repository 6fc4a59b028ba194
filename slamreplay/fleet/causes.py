"""What makes robots fail: the causes that cost the most hours, and how many robots have them."""

from __future__ import annotations

import numpy as np

from slamreplay.fleet.answers import Cause
from slamreplay.fleet.counted import Counted, groups

_S_PER_H = 3600.0


def causes(logs: Counted) -> tuple[Cause, ...]:
    """By hours lost, then hours in a changed map, then robots, then name."""
    found = []
    numbers = logs.numbers
    for kind, rows in groups(logs.cause):
        if kind is None:
            continue
        keys = logs.texts["key"][rows]
        order = np.lexsort((-numbers["changed_s"][rows], -numbers["lost_s"][rows]))
        found.append(
            Cause(
                kind=kind,
                logs=len(rows),
                robots=logs.distinct("robot", rows),
                sites=logs.distinct("site", rows),
                lost_h=float(numbers["lost_s"][rows].sum()) / _S_PER_H,
                changed_h=float(numbers["changed_s"][rows].sum()) / _S_PER_H,
                stops=int(numbers["stops"][rows].sum()),
                replayed=sum(root is not None for root in logs.texts["root_cause"][rows].tolist()),
                example=keys[order[0]],
            )
        )
    return tuple(sorted(found, key=lambda c: (-c.lost_h, -c.changed_h, -c.robots, c.kind)))
