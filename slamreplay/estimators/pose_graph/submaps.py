"""Submaps: stretches of the way whose scans are laid together, and the motions between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.estimators.scan_matching.local import LocalTrajectory
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import swing, turned
from slamreplay.matching.thinning import thin

#: A submap holds so many nodes at the most, where the robot turns on the spot.
MOST_NODES = 20
SPACING_M = 0.1


@dataclass(frozen=True, eq=False)
class Submaps:
    """C stretches of nodes, one after the other.

    Attributes:
        stops: (C + 1,) first node of each, and K.
        reference: (C,) the node in whose axes each is drawn.
        motion: (C - 1, 3) from each reference to the next.
        motion_cov: (C - 1, 3, 3) about axes of the earlier one.
        clouds: C arrays (M, 2) of points about the reference.
        way: (K,) way to each node, m; a break adds `apart_m`.
    """

    stops: NDArray[np.int64]
    reference: NDArray[np.int64]
    motion: se2.Array
    motion_cov: se2.Array
    clouds: tuple[se2.Array, ...]
    way: se2.Array

    def __len__(self) -> int:
        return len(self.reference)

    def covariance(self, first: int, last: int) -> se2.Array:
        """(3, 3) of the motion from submap `first` to `last`, about axes of the first."""
        return chain_covariances(
            self._from(first, last), self.motion_cov[first:last], np.array([0, last - first])
        )[0]

    def between(self, first: int, last: int) -> se2.Array:
        """(3,) motion from submap `first` to `last`."""
        return np.asarray(self._from(first, last)[-1])

    def _from(self, first: int, last: int) -> se2.Array:
        poses = [np.zeros(3)]
        for step in self.motion[first:last]:
            poses.append(se2.compose(poses[-1], step))
        return np.array(poses)


def submaps(
    local: LocalTrajectory, submap_m: float, apart_m: float, motion_scale: float = 1.0
) -> Submaps:
    """Cut a local trajectory by the way driven; what is cut early does not depend on what follows.

    Args:
        local: what scan matching gives.
        submap_m: length along the way, m.
        apart_m: way that a break counts for, m.
        motion_scale: ratio by which covariances of the motions are changed.
    """
    poses, count = local.node_xyyaw, len(local.nodes)
    step = np.diff(poses[:, :2], axis=0)
    length = np.hypot(step[:, 0], step[:, 1]) + apart_m * local.is_break[1:]
    way = np.append(0.0, np.cumsum(length))
    stops = [0]
    for k in range(1, count):
        full = way[k] - way[stops[-1]] >= submap_m or k - stops[-1] >= MOST_NODES
        if full or local.is_break[k]:
            stops.append(k)
    bounds = np.array([*stops, count], dtype=np.int64)
    reference = (bounds[:-1] + bounds[1:]) // 2
    cov = chain_covariances(poses, local.motion_cov * motion_scale, reference)
    return Submaps(
        bounds,
        reference,
        se2.between(poses[reference[:-1]], poses[reference[1:]]),
        cov,
        tuple(
            _cloud(local, *ends) for ends in zip(bounds[:-1], bounds[1:], reference, strict=True)
        ),
        way,
    )


def chain_covariances(poses: se2.Array, motion_cov: se2.Array, at: NDArray[np.int64]) -> se2.Array:
    """Covariances (M - 1, 3, 3) of the motions between some poses of a chain, axes of the earlier.

    Args:
        poses: (K, 3) of the chain.
        motion_cov: (K - 1, 3, 3) of each motion, about axes of the earlier pose.
        at: (M,) which poses, ascending.
    """
    if len(at) < 2:
        return np.empty((0, 3, 3))
    inside = np.arange(at[0], at[-1])
    end = at[np.searchsorted(at, inside, side="right")]
    # The error of a step swings what comes after it about where the step ends.
    by = swing(poses[end], poses[inside + 1])
    each = by @ turned(motion_cov[inside], poses[inside, 2]) @ np.swapaxes(by, 1, 2)
    total = np.add.reduceat(each, at[:-1] - at[0], axis=0)
    return turned(total, -poses[at[:-1], 2])


def _cloud(local: LocalTrajectory, first: int, stop: int, reference: int) -> se2.Array:
    poses = local.node_xyyaw
    inside = se2.between(poses[reference], poses[first:stop])
    clouds = [
        se2.transform_points(pose, local.points[k])
        for k, pose in zip(range(first, stop), inside, strict=True)
    ]
    return thin(np.concatenate(clouds), SPACING_M)
