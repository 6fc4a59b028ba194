"""Two ways to map and to localize one after the other, the map taken as exact in both."""

from __future__ import annotations

import numpy as np

from slamreplay.estimators.kalman import correct
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import turned
from slamreplay.graph.landmarks import Evidence, Posterior, most_probable
from slamreplay.labs.joint_estimation.drive import first_guess


def map_then_localise(evidence: Evidence, odometry: se2.Array) -> Posterior:
    """The whole map from odometry (K, 3) taken as exact, then the poses in it, taken as exact."""
    guess = first_guess(evidence, odometry)
    mapped = most_probable(evidence, odometry, guess, "poses")
    return most_probable(evidence, odometry, mapped.landmarks, "landmarks")


def step_by_step(evidence: Evidence, start_xyyaw: se2.Array) -> Posterior:
    """At each pose: localize in the map so far, then add what is new from the pose that came out.

    An extended Kalman filter of the pose alone. What it mapped is never mended, and neither the
    error of the map nor what it shares with that of the pose is counted.
    """
    count, landmarks = len(evidence.motions) + 1, int(evidence.landmark.max()) + 1
    x, P = np.array(start_xyyaw, dtype=np.float64), np.zeros((3, 3))
    places, spread = np.full((landmarks, 2), np.nan), np.zeros((landmarks, 2, 2))
    xyyaw, cov = np.empty((count, 3)), np.empty((count, 3, 3))
    noise = np.array([evidence.bearing_sigma, evidence.range_sigma_m]) ** 2
    rows = np.searchsorted(evidence.pose_index, np.arange(count + 1))
    for k in range(count):
        if k:
            x, P = _moved(x, P, evidence.motions[k - 1], evidence.motion_cov[k - 1])
        seen = np.arange(rows[k], rows[k + 1])
        known = seen[np.isfinite(places[evidence.landmark[seen], 0])]
        if len(known):
            at = places[evidence.landmark[known]] - x[:2]
            reach = np.hypot(at[:, 0], at[:, 1])
            bearing = np.arctan2(at[:, 1], at[:, 0]) - x[2]
            H = np.zeros((len(known), 2, 3))
            H[:, 0, 0], H[:, 0, 1], H[:, 0, 2] = at[:, 1] / reach**2, -at[:, 0] / reach**2, -1.0
            H[:, 1, :2] = -at / reach[:, None]
            off = np.column_stack(
                [se2.wrap_angle(evidence.bearing[known] - bearing), evidence.reach[known] - reach]
            )
            R = np.diag(np.tile(noise, len(known)))
            done = correct(x, P, off.ravel(), H.reshape(-1, 3), R)
            x, P = done.x, done.P
        new = np.setdiff1d(seen, known)
        angle = x[2] + evidence.bearing[new]
        ray = np.column_stack([np.cos(angle), np.sin(angle)])
        places[evidence.landmark[new]] = x[:2] + evidence.reach[new, None] * ray
        xyyaw[k], cov[k] = x, P
    return Posterior(xyyaw, cov, places, spread)


def _moved(
    x: se2.Array, P: se2.Array, motion: se2.Array, motion_cov: se2.Array
) -> tuple[se2.Array, se2.Array]:
    """Pose and covariance after a motion with noise in axes of the pose it begins at."""
    after = se2.compose(x, motion)
    F = np.eye(3)
    F[0, 2], F[1, 2] = -(after[1] - x[1]), after[0] - x[0]
    return after, F @ P @ F.T + turned(motion_cov[None], x[2:3])[0]
