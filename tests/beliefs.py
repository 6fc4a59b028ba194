"""Beliefs made by hand: errors of a known distribution on a known path, and a check's context."""

import numpy as np
from scipy.signal import lfilter

from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence.source import Reference
from slamreplay.geometry import se2
from slamreplay.testing.synthetic import synthetic_bundle

#: Position and heading are coupled, so that the pose is judged as one.
COUPLED = np.array([[0.04, 0.01, 0.004], [0.01, 0.09, -0.006], [0.004, -0.006, 0.01]])
#: As AMCL publishes it: they are not, so that position and heading are judged apart.
APART = np.diag([0.04, 0.09, 0.01])


def ar1(rng, n, rho, dof):
    """A stationary series (n, dof) of unit variance: errors of one log follow each other."""
    noise = rng.standard_normal((n, dof)) * np.sqrt(1 - rho**2)
    noise[0] = rng.standard_normal(dof)
    return lfilter([1.0], [1.0, -rho], noise, axis=0)


def context(white, cov=COUPLED, kind="simulation"):
    """A context whose belief errs by L w, w (N, 3), and claims L L' = `cov` (3, 3) or (N, 3, 3)."""
    n = len(white)
    t = np.arange(n, dtype=np.int64) * 100_000_000
    cov = np.broadcast_to(cov, (n, 3, 3)) * (1 + 1e-9 * np.arange(n))[:, None, None]
    truth = np.column_stack([t / 1e9, np.sin(t / 3e9), se2.wrap_angle(t / 2e9)])
    belief = truth + np.einsum("nij,nj->ni", np.linalg.cholesky(cov), white)
    belief[:, 2] = se2.wrap_angle(belief[:, 2])
    track = PoseTrack("map", "base", t, belief, cov)
    reference = Reference(kind, "/truth", PoseTrack.without_covariance("map", "base", t, truth))
    return CheckContext(track, (reference,), synthetic_bundle(seconds=1.0).view(), "ekf")
