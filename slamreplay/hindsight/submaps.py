"""Overlapping stretches of the trajectory, each a cloud that can be found on the map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.hindsight.chain import Chain
from slamreplay.matching.field import WorkingMap
from slamreplay.matching.thinning import thin_persistent
from slamreplay.matching.whole_map import MAX_POINTS

LENGTH, STRIDE = 25, 12
SPACING_M, RADIUS_M = 0.2, 12.0
#: Rays in a submap that are followed through a hypothesis, and how far before their end.
RAYS, SHORT_M = 150, 0.4


@dataclass(frozen=True, eq=False)
class Submap:
    """Consecutive keyframes about a reference keyframe in their middle.

    Attributes:
        first: index of its first keyframe.
        stop: index after its last.
        reference: index of the keyframe whose frame the points are in.
        points: (N, 2) thinned points, m.
        rays: (R, 4) x y of the start and of the end of some beams that hit.
    """

    first: int
    stop: int
    reference: int
    points: se2.Array
    rays: se2.Array


def submaps(chain: Chain, points: Sequence[se2.Array], laser_xy: se2.Array) -> list[Submap]:
    """Submaps that overlap by half and never reach over a break of the chain."""
    cuts = [0, *np.flatnonzero(chain.is_break[1:]) + 1, len(points)]
    found = []
    for start, stop in pairwise(cuts):
        firsts = list(range(start, max(start + 1, stop - LENGTH + 1), STRIDE))
        if firsts[-1] + LENGTH < stop:
            firsts.append(stop - LENGTH)
        found += [_submap(chain, points, laser_xy, f, min(f + LENGTH, stop)) for f in firsts]
    return [s for s in found if len(s.points)]


def _submap(
    chain: Chain, points: Sequence[se2.Array], laser_xy: se2.Array, first: int, stop: int
) -> Submap:
    reference = (first + stop) // 2
    relative = se2.between(chain.xyyaw[reference], chain.xyyaw[first:stop])
    members = range(first, stop)
    clouds = [
        se2.transform_points(pose, points[k]) for k, pose in zip(members, relative, strict=True)
    ]
    cloud = np.concatenate(clouds)
    view = np.repeat(np.arange(len(clouds)), [len(c) for c in clouds])
    near = np.hypot(*cloud.T) < RADIUS_M
    if np.count_nonzero(near) >= len(cloud) // 4:
        # Far points would need a finer heading lattice, and say no more than the near ones.
        kept = thin_persistent(cloud[near], view[near], SPACING_M, MAX_POINTS)
    else:
        kept = thin_persistent(cloud, view, SPACING_M, MAX_POINTS)
    starts = se2.transform_points(relative, np.asarray(laser_xy)[None, :])[:, 0][view]
    some = np.linspace(0, len(cloud) - 1, min(RAYS, len(cloud))).astype(np.int64)
    return Submap(first, stop, reference, kept, np.hstack([starts[some], cloud[some]]))


def blocked_share(working: WorkingMap, submap: Submap, poses: se2.Array) -> se2.Array:
    """(K,) share of a submap's rays that a mapped wall should have stopped, at poses (K, 3)."""
    rays = np.empty((len(poses), len(submap.rays), 4))
    rays[..., :2] = se2.transform_points(poses, submap.rays[:, :2])
    rays[..., 2:] = se2.transform_points(poses, submap.rays[:, 2:])
    rays -= np.tile(working.corner_xy, 2)
    blocked = np.zeros(rays.shape[:2], dtype=bool)
    cell = working.resolution_m
    _blocked(working.walls, rays / cell, SHORT_M / cell, blocked)
    return np.asarray(blocked.mean(axis=1)) if rays.size else np.zeros(len(poses))


@njit(cache=True)
def _blocked(walls, rays, short, out):  # type: ignore[no-untyped-def]
    """Which rays (K, R, 4), in cells, cross a wall more than `short` cells before their end."""
    height, width = walls.shape
    for k in range(rays.shape[0]):
        for r in range(rays.shape[1]):
            x, y = rays[k, r, 0], rays[k, r, 1]
            dx, dy = rays[k, r, 2] - x, rays[k, r, 3] - y
            length = np.sqrt(dx * dx + dy * dy)
            if length <= short:
                continue
            for i in range(int(length - short)):
                col, row = int(x + dx * i / length), int(y + dy * i / length)
                if 0 <= row < height and 0 <= col < width and walls[row, col]:
                    out[k, r] = True
                    break


def owners(found: Sequence[Submap], count: int) -> NDArray[np.int64]:
    """(count,) for each keyframe the submap whose reference is nearest among those that hold it.

    -1 where none does.
    """
    owner = np.full(count, -1, dtype=np.int64)
    distance = np.full(count, np.iinfo(np.int64).max)
    for i, submap in enumerate(found):
        members = np.arange(submap.first, submap.stop)
        apart = np.abs(members - submap.reference)
        closer = apart < distance[members]
        owner[members[closer]], distance[members[closer]] = i, apart[closer]
    return owner
