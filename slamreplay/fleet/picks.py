"""Logs worth looking at first: one of each kind before a second of any, the costly ones first."""

from __future__ import annotations

import numpy as np

from slamreplay.fleet.answers import Pick
from slamreplay.fleet.counted import CHANGED, LOST, Counted
from slamreplay.fleet.gathered import Gathered
from slamreplay.fleet.spots import spot_of_loss
from slamreplay.fleet.words import duration

#: So many are worth a person's morning.
MOST = 40
#: What a log costs, in seconds of a lost robot: a stop is a person's walk, a changed map slows
#: robots down, and a log that cannot be judged may hide anything.
STOP_S, CHANGED_SHARE, UNREADABLE_S, DOUBTFUL_S, GATE_S = 30.0, 0.1, 60.0, 30.0, 60.0
#: Verdicts that are less sure than this are for a person to decide.
SURE = 0.7


def picks(logs: Counted, found: Gathered) -> tuple[Pick, ...]:
    """The first `MOST`: by place within their kind, site and spot, then by cost, then by key."""
    kind, cost = _kinds(logs), _cost(logs)
    spots = spot_of_loss(found)
    site, state = logs.texts["site"].tolist(), logs.texts["state"].tolist()
    alike: dict[tuple[object, ...], list[int]] = {}
    for k, what in enumerate(kind):
        if what is not None:
            spot = spots.get(k) if state[k] in LOST else None
            where = None if spot is None else (spot, logs.texts["map_version"][k])
            alike.setdefault((what, site[k], where), []).append(k)
    ranked = []
    for rows in alike.values():
        rows.sort(key=lambda k: (-cost[k], k))
        ranked += [(place, -cost[k], k, len(rows)) for place, k in enumerate(rows)]
    return tuple(_pick(logs, k, str(kind[k]), many) for _, _, k, many in sorted(ranked)[:MOST])


def _kinds(logs: Counted) -> list[str | None]:
    """What is odd about each log; None where nothing is."""
    confidence = logs.numbers["confidence"]
    columns = (
        logs.failed.tolist(),
        logs.texts["state"].tolist(),
        logs.cause.tolist(),
        logs.texts["gate"].tolist(),
        ((confidence < SURE) | (logs.texts["state"] == "unobservable")).tolist(),
        (logs.numbers["stops"] > 0).tolist(),
    )
    return [_kind(*row) for row in zip(*columns, strict=True)]


def _kind(
    failed: bool, state: str | None, cause: str | None, gate: str | None, doubt: bool, stops: bool
) -> str | None:
    if failed:
        return "unreadable"
    if state in LOST or state in CHANGED:
        return cause or state
    if gate == "failed":
        return "gate"
    if doubt:
        return "doubtful"
    return "stopped" if stops else None


def _cost(logs: Counted) -> list[float]:
    numbers = logs.numbers
    cost = numbers["lost_s"] + CHANGED_SHARE * numbers["changed_s"] + STOP_S * numbers["stops"]
    cost += UNREADABLE_S * logs.failed + GATE_S * (logs.texts["gate"] == "failed")
    cost += DOUBTFUL_S * np.nan_to_num(numbers["confidence"] < SURE)
    return [float(value) for value in cost]


def _pick(logs: Counted, k: int, kind: str, many: int) -> Pick:
    texts = logs.texts
    return Pick(
        key=texts["key"][k],
        log=texts["log"][k] or "",
        report=texts["report"][k],
        site=texts["site"][k],
        robot=texts["robot"][k],
        day=logs.day[k],
        state=texts["state"][k],
        kind=kind,
        reason=_reason(logs, k, kind),
        alike=many,
    )


def _reason(logs: Counted, k: int, kind: str) -> str:
    numbers = logs.numbers
    if kind == "unreadable":
        return f"it could not be judged: {logs.texts['error'][k] or 'nobody knows why'}"
    said = []
    if numbers["lost_s"][k] > 0:
        said.append(f"lost for {duration(float(numbers['lost_s'][k]))}")
    if numbers["changed_s"][k] > 0:
        said.append(f"in a changed map for {duration(float(numbers['changed_s'][k]))}")
    stops = int(numbers["stops"][k])
    if stops:
        said.append("one unplanned stop" if stops == 1 else f"{stops} unplanned stops")
    if logs.texts["gate"][k] == "failed":
        said.append("the gate failed it")
    sure = float(numbers["confidence"][k])
    if sure < SURE:
        said.append(f"the verdict is only {100.0 * sure:.0f} % sure")
    elif logs.texts["state"][k] == "unobservable":
        said.append("more than one place explains it")
    return ", ".join(said)
