"""From nodes to scans: poses and covariances of every row."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.estimators.pose_graph.beginning import Beginning
from slamreplay.estimators.pose_graph.candidates import Closed
from slamreplay.estimators.pose_graph.submaps import Submaps, chain_covariances
from slamreplay.estimators.scan_matching.local import LocalTrajectory
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import swing, turned


def carried(local: LocalTrajectory, poses: se2.Array) -> se2.Array:
    """Poses (N, 3) of all scans where the nodes are moved to (K, 3).

    As `LocalTrajectory.carried`; but scans right before a break that fitted nothing were taken
    where the break ends: the robot was somewhere else already.
    """
    out = local.carried(poses)
    for rows, node in _before_breaks(local):
        here = local.node_xyyaw[node]
        out[rows] = se2.compose(poses[node], se2.between(here, local.xyyaw[rows]))
    return out


def _before_breaks(local: LocalTrajectory) -> list[tuple[NDArray[np.int64], int]]:
    """Scans that belong to the node after a break, and that node."""
    found = []
    for node in np.flatnonzero(local.is_break[1:]) + 1:
        last, before = int(local.nodes[node]), int(local.nodes[node - 1])
        fits = local.fits[before + 1 : last]
        used = [k for k, fit in enumerate(fits) if fit is not None and fit.accepted]
        first = before + 2 + used[-1] if used else before + 1
        found.append((np.arange(first, last), int(node)))
    return found


def carried_covariances(local: LocalTrajectory, poses: se2.Array, cov: se2.Array) -> se2.Array:
    """Covariances (N, 3, 3) of all scans from those of the nodes (K, 3, 3) at `poses` (K, 3).

    A scan between two nodes has of both their errors what `carried` takes of their poses. What each
    scan misses by itself, and its neighbours do not, comes on top.
    """
    out = np.full((len(local.xyyaw), 3, 3), np.nan)
    node = local.node_of
    rows = np.flatnonzero(node >= 0)
    here = carried(local, poses)[rows]
    low = node[rows]
    high = np.minimum(low + 1, len(local.nodes) - 1)
    high = np.where(local.is_break[high], low, high)
    for late, after in _before_breaks(local):
        low[late - rows[0]] = high[late - rows[0]] = after
    first, last = local.nodes[low], local.nodes[high]
    part = ((rows - first) / np.maximum(last - first, 1))[:, None, None]
    each = [_swung(here, poses[k], cov[k]) for k in (low, high)]
    own = turned(local.cov[rows], here[:, 2] - local.xyyaw[rows, 2])
    total = (1.0 - part) * each[0] + part * each[1] + own
    out[rows] = (total + np.swapaxes(total, 1, 2)) / 2.0
    return out


def as_driven(
    local: LocalTrajectory, maps: Submaps, closed: Closed, start: Beginning
) -> tuple[se2.Array, se2.Array]:
    """What was believed at every scan, when nothing after it was known: poses and covariances.

    A submap is done when the next one begins. Until then scans go by the last one that was done,
    and at first by the start.

    Args:
        local: every scan in the local frame.
        maps: the submaps.
        closed: where each was believed to be when it was done; with covariances.
        start: pose of the first node.
    """
    nodes = local.node_xyyaw
    done = local.nodes[np.minimum(maps.stops[1:], len(nodes) - 1)]
    done[-1] = len(local.xyyaw)  # the last one is never followed by another
    rows = np.flatnonzero(local.node_of >= 0)
    which = np.searchsorted(done, rows, side="right") - 1
    on = np.where(which >= 0, maps.reference[which], 0)
    poses = np.where(which[:, None] >= 0, closed.belief[which], start.xyyaw)
    start_cov = np.where(which[:, None, None] >= 0, closed.belief_cov[which], start.cov)
    xyyaw = np.full_like(local.xyyaw, np.nan)
    cov = np.full((len(xyyaw), 3, 3), np.nan)
    xyyaw[rows] = se2.compose(poses, se2.between(nodes[on], local.xyyaw[rows]))
    last = local.node_of[rows]
    since = _since(local, on, last)
    along = se2.compose(poses, se2.between(nodes[on], nodes[last]))
    total = _swung(along, poses, start_cov) + turned(since, poses[:, 2])
    total = _swung(xyyaw[rows], along, total)
    own = turned(local.cov[rows], xyyaw[rows, 2] - local.xyyaw[rows, 2])
    total = total + own
    cov[rows] = (total + np.swapaxes(total, 1, 2)) / 2.0
    return xyyaw, cov


def _since(local: LocalTrajectory, on: np.ndarray, last: np.ndarray) -> se2.Array:
    """(M, 3, 3) of the motion from nodes `on` to nodes `last` (M,), about axes of the former."""
    ends, where = np.unique(np.column_stack([on, last]), axis=0, return_inverse=True)
    poses = local.node_xyyaw
    each = np.zeros((len(ends), 3, 3))
    for k, (a, b) in enumerate(ends.tolist()):
        if b > a:
            each[k] = chain_covariances(poses, local.motion_cov, np.array([a, b]))[0]
    return np.asarray(each[where.ravel()])


def _swung(there: se2.Array, here: se2.Array, cov: se2.Array) -> se2.Array:
    by = swing(there, here)
    return np.asarray(by @ cov @ np.swapaxes(by, -1, -2))
