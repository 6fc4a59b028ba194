"""Where robots get lost: squares of a map in which more logs become lost than pass without."""

from __future__ import annotations

import numpy as np

from slamreplay.consistency.statistics.shares import wilson
from slamreplay.fleet.answers import SPOT_M, Share, Spot
from slamreplay.fleet.counted import Counted
from slamreplay.fleet.gathered import ENTERED, HERE, LOST, PASSED, SPOT_LOGS, Gathered

#: Spots that fewer logs passed, or that robots were at for less time, tell nothing of the place.
LEAST_LOGS, LEAST_S = 3, 30.0


def spots(logs: Counted, found: Gathered) -> tuple[Spot, ...]:
    """By the lower end of the interval of the share of logs that became lost there.

    That is what is sure of a spot: one log of one that passed does not come before five of ten.
    """
    sums = found.spots.added
    chosen = np.flatnonzero(
        (sums[:, SPOT_LOGS] > 0) & (sums[:, PASSED] >= LEAST_LOGS) & (sums[:, HERE] >= LEAST_S)
    )
    index, col, row = (part[chosen] for part in found.spots.split())
    lost = found.lost
    became = np.flatnonzero(lost.entered > 0)
    became = became[np.lexsort((lost.log[became], -lost.lost_s[became], lost.spot[became]))]
    spot = lost.spot[became]
    answers = []
    for k, map_index, x, y in zip(
        chosen.tolist(), index.tolist(), col.tolist(), row.tolist(), strict=True
    ):
        code = found.spots.code[k]
        rows = lost.log[became[slice(*np.searchsorted(spot, [code, code + 1]))]]
        count, n = int(sums[k, SPOT_LOGS]), int(sums[k, PASSED])
        site, version = found.maps[map_index]
        box = (x * SPOT_M, y * SPOT_M, (x + 1) * SPOT_M, (y + 1) * SPOT_M)
        answers.append(
            Spot(
                site=site,
                map_version=version,
                box_m=box,
                here_s=float(sums[k, HERE]),
                lost_s=float(sums[k, LOST]),
                entered=int(sums[k, ENTERED]),
                lost=Share(count, n, *wilson(count / n, n)),
                robots=logs.distinct("robot", rows),
                example=logs.texts["key"][rows[0]],
            )
        )
    return tuple(sorted(answers, key=_order))


def _order(spot: Spot) -> tuple[float, float, str, str, tuple[float, ...]]:
    low = 0.0 if spot.lost.low is None else spot.lost.low
    return -low, -spot.lost_s, spot.site or "", spot.map_version, spot.box_m


def spot_of_loss(found: Gathered) -> dict[int, int]:
    """By log, the code of the spot at which it was lost longest."""
    lost = found.lost
    order = np.lexsort((lost.spot, -lost.lost_s, lost.log))
    log, first = np.unique(lost.log[order], return_index=True)
    return dict(zip(log.tolist(), lost.spot[order][first].tolist(), strict=True))
