"""A reference in a frame of its own, laid onto the belief: a figure to look at, no judgement.

Nothing but the belief says how the two frames lie, so whatever is always wrong in it is eaten. The
reference is moved, never the belief, whose covariance is about its own axes.
"""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.evidence.nees import MAX_GAP_NS
from slamreplay.consistency.evidence.source import MAP_AXES, Evidence
from slamreplay.geometry import se2
from slamreplay.geometry.alignment import aligned
from slamreplay.geometry.covariance import is_positive_definite, swing, turned

#: Fewer updates hardly outnumber what the motion takes from them.
_LEAST = 5
_STEPS = 10


def laid_onto(updates: PoseTrack, reference: PoseTrack, source: str, kind: str) -> Evidence | None:
    """Errors of a belief's updates against a reference that a rigid motion lays onto them.

    The motion is the one of least squared whitened errors (Gauss and Newton). What it takes out of
    each error is taken out of its covariance as well: P - J (sum J' P^-1 J)^-1 J' is what residuals
    of generalised least squares have. None where too few updates have a reference.
    """
    where = reference.at(updates.t_ns, MAX_GAP_NS)
    noise = np.where(np.isfinite(where.cov), where.cov, 0.0)
    rows = where.has_pose & updates.has_pose & is_positive_definite(updates.cov)
    if rows.sum() < _LEAST:
        return None
    believed, pose, t_ns = updates.xyyaw[rows], where.xyyaw[rows], updates.t_ns[rows]
    motion = aligned(pose[:, :2], believed[:, :2])
    for _ in range(_STEPS):
        placed = se2.compose(motion, pose)
        error = believed - placed
        error[:, 2] = se2.wrap_angle(error[:, 2])
        cov = updates.cov[rows] + turned(noise[rows], np.full(len(pose), motion[2]))
        J = swing(placed, motion)
        L = np.linalg.cholesky(cov)
        A, w = np.linalg.solve(L, J), np.linalg.solve(L, error[:, :, None])
        information = np.einsum("nij,nik->jk", A, A)
        motion = motion + np.linalg.solve(information, np.einsum("nij,nik->j", A, w))
    taken = J @ np.linalg.solve(information, np.swapaxes(J, 1, 2))
    return Evidence(source, kind, t_ns, error, cov - 0.5 * (taken + np.swapaxes(taken, 1, 2)),
                    MAP_AXES)  # fmt: skip
