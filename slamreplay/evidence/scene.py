"""What there was to see at each moment of a log: what replays and exports are drawn from.

Everything is in the map frame of the log's end and on the bundle's clock. A scene computes nothing
of its own that a verdict would rest on: it lays what was found on one time axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.met import Met
from slamreplay.geometry import se2

__all__ = [
    "Lane",
    "LaneKey",
    "Mark",
    "MarkKind",
    "Met",
    "Scene",
    "SceneClouds",
    "ScenePlans",
    "SceneScans",
]

MarkKind = Literal["lost", "map_changed", "stop", "recovery", "jump", "start", "finding"]
LaneKey = Literal["error_m", "error_deg", "sigma_m", "nees", "changed_share", "match"]


@dataclass(frozen=True, eq=False)
class SceneScans:
    """Scans of one laser (or of several that were laid side by side), some or all of them.

    Attributes:
        t_ns: (N,) times, ascending.
        ends_m: (N, B, 2) float32 where each beam ended, in the base frame at the scan's stamp,
            deskewed; of a beam without return the point up to which it saw free space.
        is_hit: (N, B) whether it returned; what did not is no point to draw.
        met: (N, B) uint8 of Met.
        laser_xy: (2,) where the beams start, in the base frame, m.
    """

    t_ns: NDArray[np.int64]
    ends_m: NDArray[np.float32]
    is_hit: NDArray[np.bool_]
    met: NDArray[np.uint8]
    laser_xy: se2.Array


@dataclass(frozen=True, eq=False)
class SceneClouds:
    """Particles of the localizer where they were recorded, its own map frame's offset taken out.

    Attributes:
        t_ns: (M,) times of the clouds.
        first: (M + 1,) rows of cloud k are first[k] to first[k + 1].
        xyyaw: (P, 3) m, m, rad.
    """

    t_ns: NDArray[np.int64]
    first: NDArray[np.int64]
    xyyaw: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class ScenePlans:
    """Paths that a planner sent, as `SceneClouds` without headings.

    Attributes:
        t_ns: (M,) times.
        first: (M + 1,) points of plan k are first[k] to first[k + 1].
        xy: (P, 2) m.
    """

    t_ns: NDArray[np.int64]
    first: NDArray[np.int64]
    xy: NDArray[np.float32]


@dataclass(frozen=True)
class Mark:
    """Something at a moment (end_ns is None) or over a stretch; texts may come from the log."""

    kind: MarkKind
    t_ns: int
    end_ns: int | None
    title: str
    severity: Literal["info", "warning", "error"]


@dataclass(frozen=True, eq=False)
class Lane:
    """One number over time.

    Attributes:
        key: what it is.
        title: its name as the field says it.
        unit: of the values; empty where they have none.
        t_ns: (N,) times, ascending.
        values: (N,) NaN where not known.
        limit: beyond this (below it, of `match`) it counts against the robot; None without one.
    """

    key: LaneKey
    title: str
    unit: str
    t_ns: NDArray[np.int64]
    values: se2.Array
    limit: float | None


@dataclass(frozen=True, eq=False)
class Scene:
    """All of it; where the robot was and believed to be stands in the post-mortem's own tracks.

    Attributes:
        scans: by laser; empty without scans.
        clouds: None where no particles were recorded.
        plans: None where no plans were recorded.
        footprint_xy: (K, 2) the robot's outline in the base frame, m; a small circle's where the
            log does not tell.
        marks: by time.
        lanes: those that the log can tell, in the order they are drawn.
    """

    scans: tuple[SceneScans, ...]
    clouds: SceneClouds | None
    plans: ScenePlans | None
    footprint_xy: se2.Array
    marks: tuple[Mark, ...]
    lanes: tuple[Lane, ...]
