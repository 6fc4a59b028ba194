"""What a robot could have looked at on board, at the pose it believed in: the bar to clear."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.maps.raycast import cast_rays

#: Name to the threshold it is used with in the field: from there on it says "lost". The standard
#: deviation of the default limit of lost, als_ros's `mae` threshold, and the share of beams off
#: the map beyond which mowglinext distrusts its filter.
FIELD_THRESHOLDS = {"covariance": 0.5, "mean_absolute_error": 0.225, "beams_off": 0.5}
_MATCHES_M = 0.2


def baseline_scores(view: BundleView) -> dict[str, se2.Array]:
    """Scores per scan of the scan role, the larger the rather lost; NaN before the first belief.

    `covariance` is the largest standard deviation of position, m; `mean_absolute_error` of the
    ranges, m (als_ros, Akai 2022); `beams_off` the share of beams more than 0.2 m from where the
    map has them.
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
    lasers = se2.compose(belief.xyyaw, scans.xyyaw_base_laser)
    for i in np.flatnonzero(belief.has_pose).tolist():
        reach = float(scans.range_max_m[i])
        expected = cast_rays(grid, lasers[i : i + 1], scans.bearings(i), reach)[0]
        measured = scans.ranges_m[i].astype(np.float64)
        both = scans.hits[i] & np.isfinite(expected)
        said = scans.hits[i] | scans.misses[i]
        if both.any():
            error = np.abs(measured[both] - expected[both])
            scores["mean_absolute_error"][i] = error.mean()
        if said.any():
            a, b = np.minimum(measured[said], reach), np.minimum(expected[said], reach)
            scores["beams_off"][i] = float((np.abs(a - b) > _MATCHES_M).mean())
    return scores
