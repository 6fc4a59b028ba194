"""How sure a state is: a documented, monotone mapping, fitted to simulated incidents.

Per scan, the probability that the belief is beyond its limit is Phi((error - limit) / sigma) with
hindsight's sigma, and that the map is contradicted is Phi((share - limit) / 0.03). The belief's own
covariance says how unsure the robot was, not how unsure we are of what it believed: it counts in
NEES and in the action gate, not here. The mean over an interval's scans that its state is the right
one is drawn towards one half by how far hindsight can be trusted (its coverage, and how well the
map explains a typical scan). That raw number is then calibrated by a logistic of its log-odds
(Platt, 1999), `OFFSET + SLOPE * logit(raw)`, and kept within 1 and 99 %.

The two constants are the maximum-likelihood fit to 29 300 moments of 37 incidents that
`slamreplay.bench.incidents` makes from seeds 9000 to 9002 (all kinds but wrong maps and shifted map
frames), right meaning that the state of the moment is the true one. Raw numbers were too modest:
0.85 was right 96 times in 100, 0.94 98 times, 0.99 999 times in 1000; expected calibration error
there 0.020 before and 0.001 after. Below 0.7 there were 128 moments in all, so small numbers are
extrapolated; neighbouring moments are alike, and 37 logs cannot tell 0.99 from 0.999 for a log:
hence the upper limit. Real logs may break hindsight in ways that no simulation shows.
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
#: See the top of this module.
OFFSET, SLOPE = 1.96, 0.86


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


def confidence(p_state: se2.Array, trusted: float, unspoken: float = 0.0) -> float | None:
    """One number of the probabilities (N,) that each scan of an interval is in its state.

    Args:
        p_state: (N,) 0 to 1, NaN rows are left out.
        trusted: 0 to 1, how far hindsight is believed.
        unspoken: share of the interval without a belief: there lost or not is one half each.
    """
    p = p_state[np.isfinite(p_state)]
    if not len(p):
        return None
    sure = calibrated(0.5 + (float(p.mean()) - 0.5) * trusted)
    return float(np.clip(sure * (1.0 - 0.5 * unspoken), LOWEST, HIGHEST))


def calibrated(raw: float) -> float:
    """How often a state with this raw number (0 to 1) was the right one."""
    raw = float(np.clip(raw, 1e-4, 1.0 - 1e-4))
    return float(1.0 / (1.0 + np.exp(-(OFFSET + SLOPE * np.log(raw / (1.0 - raw))))))
