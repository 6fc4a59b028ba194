"""From places to poses: each keyframe matched to the map, all of them in one robust pose graph."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.geometry.covariance import gtsam_from_planar
from slamreplay.graph.planar import smooth_chain
from slamreplay.hindsight.chain import Chain
from slamreplay.hindsight.sensed import Sensed
from slamreplay.matching.correlative import Window, match_each
from slamreplay.matching.field import ScoreField
from slamreplay.matching.thinning import thin

WINDOWS = (
    Window(0.3, 0.1, np.radians(5.0), np.radians(1.7), pull=0.05),
    Window(0.1, 0.1, np.radians(1.5), np.radians(1.5), pull=0.02),
)
#: A keyframe whose scan fits the map worse is held by its neighbours only.
MIN_SCORE = 0.3
#: Neighbouring keyframes match the same walls with the same errors of the map: about this many
#: anchors say one thing, so each is given that much more variance. Chosen by hand: with it and
#: the floors below the mean NEES of simulated logs is 0.7 to 3 (3 is right), 10 cm maps and carried
#: robots included. Above that: short-ranged lasers among moved racks.
SAME_EVIDENCE = 3.0
#: Mean score from which on a match is taken at its word.
DOUBT_BELOW = 0.85
#: What a map and a scanner leave in any match: metres, metres, radians.
FLOOR = np.array([0.008, 0.008, 0.0015])
#: A wall lies anywhere in its cells, and all beams on it are off by the same. Cells up to FINE_M
#: add nothing that could be measured, cells of 0.1 m add 0.027 m.
FINE_M, COARSE = 0.05, 0.55


def smooth(
    field: ScoreField,
    points: Sequence[se2.Array],
    start: se2.Array,
    chain: Chain,
    is_open: NDArray[np.bool_],
    sensed: Sensed | None = None,
) -> tuple[se2.Array, se2.Array]:
    """Keyframe poses (K, 3) in the field's frame and their covariances (K, 3, 3) in its axes.

    Args:
        field: the map's score field.
        points: K scans in the base frame.
        start: (K, 3) where the places put the keyframes.
        chain: the scan-matched odometry between them.
        is_open: (K - 1,) where the motion is not known.
        sensed: tags, docks and satellite fixes that join the graph.
    """
    thinned = [thin(p, 0.1) for p in points]
    motions = se2.between(chain.xyyaw[:-1], chain.xyyaw[1:])
    cov = _motion_covariance(chain, motions)
    poses = start
    floor = floor_covariance(field)
    spread = np.broadcast_to(floor, (len(start), 3, 3))
    for window in WINDOWS:
        tops = match_each(field, thinned, poses, window)
        held = np.flatnonzero(tops.score >= MIN_SCORE)
        anchors = tops.xyyaw[held]
        anchor_cov = match_covariance(tops.information[held], tops.score[held])
        seen, fixes = (None, None) if sensed is None else sensed.constraints(poses)
        poses, spread = smooth_chain(
            poses, motions, cov, is_open, chain.is_solid[1:], held, anchors, anchor_cov, seen, fixes
        )
    return poses, spread + floor


def floor_covariance(field: ScoreField) -> se2.Array:
    """(3, 3) of what no number of beams can better: how well the map itself is drawn."""
    coarse_m = COARSE * max(0.0, field.resolution_m - FINE_M)
    return np.asarray(np.diag(FLOOR**2 + np.array([coarse_m, coarse_m, 0.0]) ** 2))


def match_covariance(information: se2.Array, score: se2.Array) -> se2.Array:
    """(N, 3, 3) covariance of matches to the map from their curvature (N, 3, 3) and scores (N,).

    A match that leaves many points unexplained may be the right one in a changed place, or the
    nearest wrong one: its variance grows fast as its score falls.
    """
    doubt = np.maximum(1.0, DOUBT_BELOW / np.maximum(score, 0.1)) ** 6
    cov = _covariance(information, np.array([1.0, 1.0, 0.3]))
    return SAME_EVIDENCE * cov * doubt[:, None, None]


def _motion_covariance(chain: Chain, motions: se2.Array) -> se2.Array:
    """(K - 1, 3, 3) in axes of the earlier pose: what the match holds, else what odometry says."""
    way, turn = np.hypot(motions[:, 0], motions[:, 1]), np.abs(motions[:, 2])
    odometry = np.column_stack([0.03 + 0.2 * way, 0.03 + 0.2 * way, 0.02 + 0.1 * turn])
    doubt = np.maximum(1.0, 0.7 / np.maximum(chain.score[1:], 0.05))
    cov = _covariance(chain.information[1:], odometry)
    cov = (cov + np.diag([0.01**2, 0.01**2, 0.003**2])) * doubt[:, None, None] ** 2
    return gtsam_from_planar(cov, chain.xyyaw[:-1, 2])


def _covariance(information: se2.Array, prior_sigma: se2.Array) -> se2.Array:
    """Inverse of information (N, 3, 3), never wider than the prior's sigmas (3,) or (N, 3)."""
    values, vectors = np.linalg.eigh(0.5 * (information + np.swapaxes(information, 1, 2)))
    sound = (vectors * np.maximum(values, 0.0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    prior = np.zeros_like(sound)
    prior[:, range(3), range(3)] = 1.0 / np.asarray(prior_sigma) ** 2
    return np.linalg.inv(sound + prior)
