"""Particles and plans, thinned to what can be told apart: places at 1 cm, headings at 1.4 deg."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.evidence.scene import SceneClouds, ScenePlans
from slamreplay.geometry import se2
from slamreplay.report.replay.tracks import Ticks

POINT_M, TURN_RAD = 0.01, 2.0 * np.pi / 256.0
#: Particles and points of plans that travel at most, of a cloud and of a plan, and of all.
_OF_CLOUD, _OF_CLOUDS = 300, 90_000
_OF_PLAN, _OF_PLANS = 120, 40_000


@dataclass(frozen=True, eq=False)
class Overlay:
    """Groups of points over time.

    Attributes:
        arrays: `_t` (M,) ticks, `_first` (M + 1,), `_xy` (2, P) in cm, of clouds also `_turn` (P,)
            in 256ths of a turn.
        groups: clouds or plans that stayed.
        of_groups: how many there were.
        points: that stayed.
        of_points: how many there were.
    """

    arrays: dict[str, NDArray]
    groups: int
    of_groups: int
    points: int
    of_points: int


def packed_clouds(clouds: SceneClouds, ticks: Ticks, origin: se2.Array) -> Overlay | None:
    """Particles; None without any."""
    return _packed("clouds", clouds.t_ns, clouds.first, clouds.xyyaw, ticks, origin)


def packed_plans(plans: ScenePlans, ticks: Ticks, origin: se2.Array) -> Overlay | None:
    """Plans; None without any."""
    return _packed("plans", plans.t_ns, plans.first, plans.xy, ticks, origin)


def _packed(
    name: str,
    t_ns: NDArray[np.int64],
    first: NDArray[np.int64],
    points: NDArray[np.float32],
    ticks: Ticks,
    origin: se2.Array,
) -> Overlay | None:
    if not len(points):
        return None
    of_one, of_all = (_OF_CLOUD, _OF_CLOUDS) if name == "clouds" else (_OF_PLAN, _OF_PLANS)
    lengths = np.minimum(np.diff(first), of_one)
    groups = np.arange(len(t_ns))[:: max(1, -(-int(lengths.sum()) // of_all))]
    sound = np.asarray(np.isfinite(points).all(axis=1))
    rows = [_evenly(int(first[g]), int(first[g + 1]), of_one) for g in groups]
    rows = [r[sound[r]] for r in rows]
    kept = points[np.concatenate(rows)].astype(np.float64)
    xy = np.round((kept[:, :2] - origin) / POINT_M)
    arrays: dict[str, NDArray] = {
        f"{name}_t": ticks.at(t_ns[groups]),
        f"{name}_first": np.append(0, np.cumsum([len(r) for r in rows])).astype(np.int32),
        f"{name}_xy": np.clip(xy, -(2**31) + 1, 2**31 - 1).T.astype(np.int32),
    }
    if points.shape[1] == 3:
        turn = np.round(kept[:, 2] / TURN_RAD)
        arrays[f"{name}_turn"] = np.mod(turn, 256.0).astype(np.uint8)
    return Overlay(arrays, len(groups), len(t_ns), len(kept), len(points))


def _evenly(first: int, stop: int, most: int) -> NDArray[np.int64]:
    """Rows [first, stop), or `most` of them; a plan keeps both ends."""
    count = stop - first
    if count <= most:
        return np.arange(first, stop)
    return first + np.round(np.linspace(0, count - 1, most)).astype(np.int64)
