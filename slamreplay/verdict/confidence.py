"""How sure a state is: a documented, monotone mapping. NOT CALIBRATED YET.

Per scan, the probability that the belief is beyond its limit is Phi((error - limit) / sigma) with
hindsight's sigma, and that the map is contradicted is Phi((share - limit) / 0.03). The belief's own
covariance says how unsure the robot was, not how unsure we are of what it believed: it counts in
NEES and in the action gate, not here. An interval's number is the mean over its scans that the
state is the right one. It is drawn towards one half by how far hindsight can be trusted (its
coverage, and how well the map explains a typical scan), and kept within 1 and 99 %. Errors of
neighbouring scans are not independent and hindsight's own mistakes are not Gaussian: read it as an
order, not as a frequency, until the benchmark's reliability diagram says otherwise.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from slamreplay.bundle.products import Hindsight
from slamreplay.geometry import se2
from slamreplay.verdict.belief_error import BeliefError, explained_match
from slamreplay.verdict.limits import Limits

#: Spread of the changed share of neighbouring scans of one scene.
SHARE_SIGMA = 0.03
#: A typical scan that the map explains this well leaves no doubt about hindsight.
GOOD_MATCH = 0.6
LOWEST, HIGHEST = 0.01, 0.99


def p_off(error: BeliefError, limits: Limits) -> se2.Array:
    """(N,) probability that the belief is beyond its limits; NaN where unknown."""
    far = ndtr((error.distance_m - limits.position_m) / error.sigma_m)
    turned = ndtr((error.heading_rad - limits.yaw_rad) / error.sigma_rad)
    return np.asarray(np.maximum(far, turned))


def p_changed(share: se2.Array, limits: Limits) -> se2.Array:
    """(N,) probability that a scan's changed share is beyond its limit."""
    return np.asarray(ndtr((share - limits.changed_share) / SHARE_SIGMA))


def trust(hindsight: Hindsight) -> float:
    """0 to 1: how far hindsight itself is believed."""
    explained = explained_match(hindsight)
    typical = np.median(explained[np.isfinite(explained)]) if np.isfinite(explained).any() else 0.0
    return float(np.clip(hindsight.coverage, 0.0, 1.0) * min(1.0, typical / GOOD_MATCH))


def confidence(p_state: se2.Array, trusted: float) -> float | None:
    """One number of the probabilities (N,) that each scan of an interval is in its state."""
    p = p_state[np.isfinite(p_state)]
    if not len(p):
        return None
    drawn = 0.5 + (float(p.mean()) - 0.5) * trusted
    return float(np.clip(drawn, LOWEST, HIGHEST))
