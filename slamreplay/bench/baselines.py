"""What a robot could have looked at on board, at the pose it believed in: the bar to clear."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import distance_transform_edt

from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.maps.raycast import cast_rays

#: Name to the threshold it is used with in the field: from there on it says "lost". The standard
#: deviation at the default limit of lost, als_ros's threshold on the mean residual, the share of
#: beams off the map beyond which mowglinext distrusts its filter, als_ros ratios scaled to 1.
FIELD_THRESHOLDS = {
    "covariance": 0.5,
    "mean_absolute_error": 0.225,
    "beams_off": 0.5,
    "misalignment_mrf": 1.0,
}
_MATCHES_M = 0.2
#: Of als_ros: residuals beyond this are left out, and fewer than so many say nothing.
_MAX_RESIDUAL_M, _MIN_RESIDUALS = 1.0, 10
_VARIANCE_M2, _LAMBDA = 0.04, 4.0
_MISALIGNED, _UNKNOWN = 0.1, 0.7
_TRANSITION = np.array([[0.8, 0.0, 0.2], [0.0, 0.8, 0.2], [1 / 3, 1 / 3, 1 / 3]])


def baseline_scores(view: BundleView) -> dict[str, se2.Array]:
    """Scores per scan of the scan role, the larger the rather lost; NaN before the first belief.

    `covariance` is the largest standard deviation of position, m; `mean_absolute_error` the mean
    distance of beam ends from the nearest mapped wall, m; `beams_off` the share of beams more than
    0.2 m from where the map has them along the beam; `misalignment_mrf` see `misalignment`.
    """
    scans, grid = scan_set(view), view.grid
    n = 0 if scans is None else len(scans)
    scores = {name: np.full(n, np.nan) for name in FIELD_THRESHOLDS}
    if scans is None or grid is None:
        return scores
    belief = recorded_belief(view, scans.t_ns)
    if belief is None:
        return scores
    variance = np.full(n, np.nan)
    known = np.isfinite(belief.cov).all(axis=(1, 2))
    variance[known] = np.linalg.eigvalsh(belief.cov[known][:, :2, :2])[:, -1]
    scores["covariance"] = np.sqrt(np.maximum(variance, 0.0))
    to_wall = distance_transform_edt(~grid.occupied, sampling=grid.resolution_m)
    lasers = se2.compose(belief.xyyaw, scans.xyyaw_base_laser)
    for i in np.flatnonzero(belief.has_pose).tolist():
        reach = float(scans.range_max_m[i])
        expected = cast_rays(grid, lasers[i : i + 1], scans.bearings(i), reach)[0]
        said = scans.hits[i] | scans.misses[i]
        if said.any():
            a = np.minimum(scans.ranges_m[i, said].astype(np.float64), reach)
            b = np.minimum(expected[said], reach)
            scores["beams_off"][i] = float((np.abs(a - b) > _MATCHES_M).mean())
        cells = grid.cell_of(se2.transform_points(belief.xyyaw[i], scans.points(i)))
        inside = grid.inside(cells)
        residuals = to_wall[cells[inside, 0], cells[inside, 1]]
        residuals = residuals[residuals <= _MAX_RESIDUAL_M]
        if len(residuals) >= _MIN_RESIDUALS:
            scores["mean_absolute_error"][i] = residuals.mean()
            scores["misalignment_mrf"][i] = misalignment(residuals)
    return scores


def misalignment(residuals_m: se2.Array) -> float:
    """How far residuals (B,) speak for a wrong pose; 1 and more is called failed.

    A Markov random field whose latent variables (each beam aligned, misaligned or from an unknown
    obstacle) are all connected, after Akai et al. (2018) with the likelihoods, transitions and
    ratios of als_ros, in one pass of messages: each beam given all the others. Where
    als_ros samples the classes, the expected ratios of misaligned and of unknown beams are taken.
    """
    e = residuals_m[:, None]
    flat = 1.0 / _MAX_RESIDUAL_M
    aligned = 2.0 * np.exp(-(e**2) / (2 * _VARIANCE_M2)) / np.sqrt(2 * np.pi * _VARIANCE_M2)
    off = _LAMBDA * np.exp(-_LAMBDA * e) / (1.0 - np.exp(-_LAMBDA * _MAX_RESIDUAL_M))
    likelihood = np.hstack(
        [0.95 * aligned + 0.05 * flat, 0.95 * off + 0.05 * flat, np.full_like(e, flat)]
    )
    likelihood /= likelihood.sum(axis=1, keepdims=True)
    messages = np.log(likelihood @ _TRANSITION.T)
    posterior = np.log(likelihood) + messages.sum(axis=0) - messages
    posterior = np.exp(posterior - posterior.max(axis=1, keepdims=True))
    posterior /= posterior.sum(axis=1, keepdims=True)
    a, m, u = posterior.mean(axis=0)
    return float(max(m / max(a + m, 1e-12) / _MISALIGNED, u / _UNKNOWN))
