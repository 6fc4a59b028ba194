"""Where in the map of the submaps before does a submap fit? One search of a window."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.estimators.pose_graph.config import GraphConfig
from slamreplay.geometry import se2
from slamreplay.matching.branch_and_bound import PoseWindow, best_pose
from slamreplay.matching.correlative import Window, match, search_window
from slamreplay.matching.field import points_field
from slamreplay.matching.pyramid import pyramid

#: Width of the score about points, and the lattice that it is drawn on; coarser for wide windows.
SIGMA_M, FINE_M, COARSE_M = 0.08, 0.05, 0.1
#: Windows wider than this are searched by branch and bound, and those wider than this coarsely.
WIDE_M, COARSE_FROM_M = 0.5, 1.5
#: Points of a submap that are searched with, and how far from its middle they may lie.
MOST_POINTS, FARTHEST_M = 200, 20.0
#: What is found by branch and bound must score at least this part of what is asked for.
HOPELESS = 0.8
#: More cells than this are never drawn at once.
ROOM = 9_000_000
#: Information that any match has: 10 m, 10 rad.
LEAST_INFORMATION = 0.01
NEAR, CLOSE = Window(0.1, 0.05, 0.03, 0.015), Window(0.05, 0.05, 0.02, 0.02)


@dataclass(frozen=True, eq=False)
class Place:
    """Where a submap fits best: `xyyaw` (3,), `score`, and the score's curvature (3, 3)."""

    xyyaw: se2.Array
    score: float
    information: se2.Array


class Searcher:
    """Searches windows, one after the other, in the same memory."""

    def __init__(self) -> None:
        self._room = np.empty(ROOM, dtype=np.float32)

    def best(
        self,
        seen: se2.Array,
        cloud: se2.Array,
        expected: se2.Array,
        reach_m: float,
        reach_rad: float,
        min_score: float,
    ) -> Place | None:
        """The best place of a window.

        Args:
            seen: (P, 2) points of the map.
            cloud: (M, 2) points of the submap about its reference.
            expected: (3,) where it should be.
            reach_m: to either side; infinite for the whole map.
            reach_rad: to either side; from pi on all headings.
            min_score: what is asked for. A wide window is not searched for what is far below.

        Returns:
            None where nothing fits.
        """
        near = np.hypot(cloud[:, 0], cloud[:, 1]) < FARTHEST_M
        few = _evenly(cloud[near], MOST_POINTS)
        if not len(few):
            return None
        spread = float(np.hypot(few[:, 0], few[:, 1]).max()) + 1.0
        start = expected
        if reach_m > WIDE_M or reach_rad > np.pi / 6.0:
            start_ = self._wide(seen, few, expected, reach_m, reach_rad, spread, min_score)
            if start_ is None:
                return None
            start, reach_m = start_, 0.3
            fine = self._field(seen, start, spread, FINE_M)
            start, _ = search_window(fine, few, start, NEAR)
        else:
            fine = self._field(seen, start, spread + reach_m, FINE_M)
            window = Window(reach_m, 0.1, reach_rad, np.radians(1.5))
            start, _ = search_window(fine, few, start, window)
        found = match(fine, cloud, start, CLOSE)
        return Place(found.xyyaw, found.score, found.information)

    def _wide(
        self,
        seen: se2.Array,
        few: se2.Array,
        expected: se2.Array,
        reach_m: float,
        reach_rad: float,
        spread: float,
        min_score: float,
    ) -> se2.Array | None:
        cell = COARSE_M if reach_m > COARSE_FROM_M else FINE_M
        field = self._field(seen, expected, spread + reach_m, cell)
        if np.isfinite(reach_m):
            window = PoseWindow(expected, (reach_m, reach_m), reach_rad)
        else:
            window = PoseWindow.whole(field)
        least = HOPELESS * min_score
        top = best_pose(pyramid(field), few, window, step_rad=cell / 5.0, min_score=least)
        return None if top is None else top.xyyaw

    def _field(self, seen: se2.Array, about: se2.Array, reach_m: float, cell_m: float):  # type: ignore[no-untyped-def]
        near = (np.abs(seen - about[:2]) < reach_m).all(axis=1)
        points = seen[near] if near.any() else about[None, :2]
        return points_field(points, max(SIGMA_M, cell_m), cell_m, self._room)


def information_of(curvature: se2.Array, config: GraphConfig) -> se2.Array:
    """Information (3, 3) of a match from the curvature of its score; definite."""
    value, vector = np.linalg.eigh((curvature + curvature.T) / 2.0 * config.trust)
    return np.asarray((vector * np.maximum(value, 0.0)) @ vector.T) + LEAST_INFORMATION * np.eye(3)


def _evenly(points: se2.Array, limit: int) -> se2.Array:
    if len(points) <= limit:
        return points
    index: NDArray[np.int64] = np.linspace(0, len(points) - 1, limit).astype(np.int64)
    return np.asarray(points[index])
