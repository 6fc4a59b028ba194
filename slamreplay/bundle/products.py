"""What hindsight hands on: where the robot really was, and what of the map was not true."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.freshness import Freshness
from slamreplay.bundle.map_course import MapStretch
from slamreplay.bundle.met import BeamsMet
from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2

#: A stretch whose place leads the best different one by less than this, in mean score of its
#: submap, is not placed by its scans. Over 1255 submaps of simulated logs the three that were wrong
#: led by at most 0.082 and the right ones by 0.10 or more (one: 0.103).
LEAST_LEAD = 0.085


@dataclass(frozen=True)
class ChangedRegion:
    """A connected patch of the map that the log contradicts.

    Attributes:
        kind: appeared (mapped free, stands there), removed (mapped wall, gone) or moved.
        bbox_m: x_min, y_min, x_max, y_max in the map frame; of a moved region the new place.
        from_bbox_m: the old place of a moved region.
        map_version: of the map it is drawn in; None is the map at the log's end.
    """

    kind: Literal["appeared", "removed", "moved"]
    bbox_m: tuple[float, float, float, float]
    area_m2: float
    first_seen_ns: int
    last_seen_ns: int
    views: int
    confidence: float
    from_bbox_m: tuple[float, float, float, float] | None = None
    map_version: str | None = None


@dataclass(frozen=True, eq=False)
class Changes:
    """Changed cells and beams.

    Beams are compared with the map version of their time. Cells are those of the version at the
    log's end; what a later version has drawn already is not among them.

    Attributes:
        appeared: (H, W) cells mapped free or unknown where something stands.
        removed: (H, W) mapped walls that are gone.
        regions: connected patches of both.
        t_ns: (N,) scan times.
        changed_share: (N,) changed beams over valid beams of each scan, NaN where none is valid.
        appeared_share: (N,) of it, nearer than the map says.
        removed_share: (N,) of it, beyond a mapped wall.
        opened: (H, W) unmapped cells beside removed walls that were seen empty; None if not known.
        freshness: when each cell was last confirmed and last contradicted.
        corrected: (H, W) int8 the map's cells as the log's end shows them; None if not known.
        met: what every beam met, by laser; those that hindsight was made of.
    """

    appeared: NDArray[np.bool_]
    removed: NDArray[np.bool_]
    regions: tuple[ChangedRegion, ...]
    t_ns: NDArray[np.int64]
    changed_share: se2.Array
    appeared_share: se2.Array
    removed_share: se2.Array
    opened: NDArray[np.bool_] | None = None
    freshness: Freshness | None = None
    corrected: NDArray[np.int8] | None = None
    met: tuple[BeamsMet, ...] = ()


@dataclass(frozen=True, eq=False)
class Hindsight:
    """The trajectory rebuilt from the whole log, and how far it can be trusted.

    Attributes:
        track: base in map, one row per scan; NaN rows where the log does not tell.
        sigma_m: typical (median) standard deviation of position.
        coverage: share of scans with a pose.
        match: (N,) mean likelihood-field score of each scan at its pose, 0 to 1; it says how well
            the map explains the scan, changes included.
        margin: by how much the best sequence of places beats the best different one, in mean score
            per scan; None where no different one was found.
        changes: what contradicts the map, seen from this trajectory.
        joined: sightings and fixes that it was made of beside scans and odometry, by kind.
        lead: (N,) by how much the place of the stretch around each scan beats the best different
            one, in mean score of that stretch; inf where there is no different one, empty where it
            was not asked. The margin is about the whole log, this about one moment.
        scale: how many times larger than the place the map is drawn; None where it is to scale, or
            where no scale fits.
        parts: what it was joined from, where the maps of the log were of several places: two
            stretches or more.
    """

    track: PoseTrack
    sigma_m: float
    coverage: float
    match: se2.Array
    margin: float | None
    changes: Changes | None
    joined: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    lead: se2.Array = field(default_factory=lambda: np.empty(0))
    scale: float | None = None
    parts: tuple[Part, ...] = ()


@dataclass(frozen=True, eq=False)
class Part:
    """Hindsight of one stretch of a log, in the maps of that stretch."""

    stretch: MapStretch
    hindsight: Hindsight
