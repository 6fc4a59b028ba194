"""One map with all that logs say of its places: what a heat map draws."""

from __future__ import annotations

import numpy as np

from slamreplay.fleet.answers import MapPlaces
from slamreplay.fleet.cells import split
from slamreplay.fleet.counted import Counted
from slamreplay.fleet.gathered import (
    AGAINST,
    ENTERED,
    HERE,
    LOOKS,
    LOST,
    LOST_LOGS,
    PASSED,
    Gathered,
)
from slamreplay.fleet.in_use import InUse


def map_places(logs: Counted, found: Gathered, in_use: InUse) -> tuple[MapPlaces, ...]:
    """One per site and map version, those in use first, most logs first."""
    by_map: dict[tuple[str | None, str | None], list[int]] = {}
    pairs = zip(logs.texts["site"].tolist(), logs.texts["map_version"].tolist(), strict=True)
    for k, pair in enumerate(pairs):
        by_map.setdefault(pair, []).append(k)
    answers = []
    for number, (site, version) in enumerate(found.maps):
        rows = found.places.of_map(number)
        _, col, row = split(found.places.code[rows])
        added = found.places.added[rows]
        of_map = np.array(by_map.get((site, version), []), dtype=np.int64)
        days = [day for day in logs.day[of_map].tolist() if day is not None]
        whole = added.astype(np.int64)
        answers.append(
            MapPlaces(
                site=site,
                map_version=version,
                logs=len(of_map),
                robots=logs.distinct("robot", of_map),
                first_day=min(days, default=None),
                last_day=max(days, default=None),
                in_use=in_use.of(site, version),
                col=col.astype(np.int32),
                row=row.astype(np.int32),
                here_s=added[:, HERE],
                lost_s=added[:, LOST],
                entered=whole[:, ENTERED],
                passed=whole[:, PASSED],
                lost_logs=whole[:, LOST_LOGS],
                seen_m2=found.places.greatest[rows],
                looks=whole[:, LOOKS],
                against=whole[:, AGAINST],
            )
        )
    key = lambda m: (not m.in_use, -m.logs, m.site is None, m.site or "", m.map_version)  # noqa: E731
    return tuple(sorted(answers, key=key))
