"""How likely what was seen is, if replays are what happens with one thing put back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, logsumexp

from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.rootcause.incident import Incident
from slamreplay.rootcause.replays import Replay

#: Moments that are compared: one a second from so long before the onset on.
EVERY_NS, BEFORE_NS = NS_PER_S, 6 * NS_PER_S
#: Spread of what was seen about a replay: a floor, and a share of the replay's own error, for what
#: a filter does after it is lost hangs on chance and on parameters that the log does not tell.
FLOOR_M, FLOOR_RAD, SHARE = 0.15, np.radians(4.0), 0.25
#: Spread of the logarithm of the published standard deviation about the replay's.
LN_SIGMA = 0.4
#: Degrees of freedom of the Student t.
NU = 3.0
#: Errors within so many seconds are alike: the sum over moments is divided by it.
ALIKE_S = 4.0


def moments(incident: Incident) -> NDArray[np.int64]:
    """Rows that are compared, among those at which hindsight can be trusted."""
    t = incident.t_ns
    known = incident.known & np.isfinite(incident.belief).all(axis=1)
    rows = np.searchsorted(t, np.arange(incident.onset_ns - BEFORE_NS, t[-1] + 1, EVERY_NS))
    rows = np.unique(rows[rows < len(t)])
    return np.asarray(rows[known[rows]])


def log_likelihood(
    incident: Incident, truth: se2.Array, replays: Sequence[Replay], rows: NDArray[np.int64]
) -> float:
    """Logarithm of the density of the seen errors and sigmas: a mixture over the replays.

    At each moment the error of the belief, in the frame of hindsight, is a Student t about the
    replayed error, place and heading apart (Lange, Little, Taylor: Robust statistical modeling
    using the t distribution, JASA 84, 1989); its scale takes in how far the replays lie apart.

    Args:
        incident: what was seen.
        truth: (N, 3) where the robot was.
        replays: with different random numbers.
        rows: which of the N to compare.
    """
    seen = se2.between(truth[rows], incident.belief[rows])
    made = np.array([se2.between(truth[rows], one.xyyaw[rows]) for one in replays])
    spread_m = np.sqrt(made[:, :, :2].var(axis=0).sum(axis=1))
    spread_rad = np.abs(se2.wrap_angle(made[:, :, 2] - made[:1, :, 2])).max(axis=0)
    sigma = sigma_of(incident.cov[rows])
    each = []
    for one, errors in zip(replays, made, strict=True):
        metres, radians = np.hypot(*errors[:, :2].T), np.abs(se2.wrap_angle(errors[:, 2]))
        share = SHARE if one.by_chance else 0.0
        scale_m = np.sqrt(FLOOR_M**2 + (share * metres) ** 2 + spread_m**2)
        scale_rad = np.sqrt(FLOOR_RAD**2 + (share * radians) ** 2 + spread_rad**2)
        off_m = np.hypot(*(seen - errors)[:, :2].T)
        off_rad = np.abs(se2.wrap_angle(seen[:, 2] - errors[:, 2]))
        value = student(off_m / scale_m, 2) - 2.0 * np.log(scale_m)
        value += student(off_rad / scale_rad, 1) - np.log(scale_rad)
        value += _of_sigma(sigma, one.sigma_m[rows])
        each.append(value.sum() / ALIKE_S)
    return float(logsumexp(each) - np.log(len(each)))


def _of_sigma(seen: NDArray[np.float64], made: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of the published standard deviations; one that a replay has not is one spread off."""
    both = np.isfinite(seen) & np.isfinite(made)
    ratio = np.where(both, np.log(np.where(both, seen, 1.0) / np.where(both, made, 1.0)), LN_SIGMA)
    value = student(np.abs(ratio) / LN_SIGMA, 1) - np.log(LN_SIGMA)
    return np.where(np.isfinite(seen), value, 0.0)


def student(radius: NDArray[np.float64], d: int) -> NDArray[np.float64]:
    """Logarithm of the density of a d-variate Student t of unit scale at a radius."""
    constant = gammaln((NU + d) / 2) - gammaln(NU / 2) - d / 2 * np.log(NU * np.pi)
    return np.asarray(constant - (NU + d) / 2 * np.log1p(radius**2 / NU))


def sigma_of(cov: se2.Array) -> NDArray[np.float64]:
    """(N,) larger standard deviation of the position of covariances (N, 3, 3), m; NaN without."""
    known = np.isfinite(cov).all(axis=(1, 2))
    out = np.full(len(cov), np.nan)
    if known.any():
        largest = np.linalg.eigvalsh(cov[known][:, :2, :2])[:, -1]
        out[known] = np.sqrt(np.maximum(largest, 1e-6))
    return out
