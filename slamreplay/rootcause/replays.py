"""The particle filter over arrays: what a localizer makes of evidence that was healed or spoilt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.estimators.amcl.filter import AmclFilter
from slamreplay.estimators.amcl.laser import Beams
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid


@dataclass(frozen=True, eq=False)
class Evidence:
    """What a filter is given.

    Attributes:
        odometry: (N, 3) pose in odom at which it takes each scan.
        beams: one per row, None where there is no scan.
        grid: its map.
        start: (3,) pose it begins with, in the map.
        cov: (3, 3) of it.
        config: its parameters.
        distance_m: (H, W) of that map, from each cell to the nearest wall.
        set_again: poses and covariances it is set to later, by row.
    """

    odometry: se2.Array
    beams: tuple[Beams | None, ...]
    grid: OccupancyGrid
    start: se2.Array
    cov: se2.Array
    config: AmclConfig
    distance_m: NDArray[np.float32]
    set_again: tuple[tuple[int, se2.Array, se2.Array], ...] = ()


@dataclass(frozen=True, eq=False)
class Replay:
    """What it made of that.

    Attributes:
        xyyaw: (N, 3) its belief at each row.
        sigma_m: (N,) the larger standard deviation of its position, as published.
        updates: how many scans it took in.
        by_chance: whether a filter made it, whose error is known to a share of it only.
    """

    xyyaw: se2.Array
    sigma_m: NDArray[np.float64]
    updates: int
    by_chance: bool = True


def replayed(evidence: Evidence, seed: int) -> Replay:
    """Run the filter over the rows once; the same seed gives the same bits."""
    e = evidence
    amcl = AmclFilter(e.config, e.grid, seed, e.distance_m)
    n = len(e.odometry)
    xyyaw, sigma = np.empty((n, 3)), np.empty(n)
    scans = np.array([b is not None for b in e.beams])
    stops = [(0, e.start, e.cov), *e.set_again]
    ends = [row for row, _, _ in stops[1:]] + [n]
    updates = 0
    for (at, pose, cov), end in zip(stops, ends, strict=True):
        amcl.initialise(pose, cov)
        said, since = np.asarray(pose, dtype=np.float64), at
        spread = _sigma(cov)
        here = at
        while here < end:
            due = here + amcl.first_due(e.odometry[here:end])
            while due < end and not scans[due]:
                due += 1
            _carry(e.odometry, said, since, here, due, xyyaw)
            sigma[here:due] = spread
            if due == end:
                break
            amcl.predict(e.odometry[due])
            beams = e.beams[due]
            assert beams is not None
            amcl.correct(beams)
            updates += 1
            said, since, spread = amcl.published.mean_xyyaw, due, _sigma(amcl.published.cov)
            xyyaw[due], sigma[due] = said, spread
            here = due + 1
    return Replay(xyyaw, sigma, updates)


def _carry(
    odometry: se2.Array, said: se2.Array, since: int, low: int, high: int, out: se2.Array
) -> None:
    """Fill rows [low, high) with what was said at row `since`, moved by odometry."""
    if high > low:
        out[low:high] = se2.compose(said, se2.between(odometry[since], odometry[low:high]))


def _sigma(cov: se2.Array) -> float:
    return float(np.sqrt(np.linalg.eigvalsh(np.asarray(cov)[:2, :2])[-1]))
