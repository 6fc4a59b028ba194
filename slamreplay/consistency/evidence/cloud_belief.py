"""What a particle filter believed, where it recorded its particles and no covariance.

Many localizers tell their pose by tf alone. Their cloud is their belief all the same: its mean and
its covariance belong together by construction, and NEES may judge them.
"""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry.covariance import is_positive_definite
from slamreplay.geometry.transforms import clean_frame

#: Fewer particles are a drawing, not a distribution.
_FEWEST = 20


def cloud_belief(view: BundleView) -> PoseTrack | None:
    """Mean and covariance of every cloud in the map's frame, base in map, sorted by time.

    None where no topic plays the role, or no cloud is of the map, has `_FEWEST` particles and a
    spread in every direction. A cloud that says the same as the one before is left out: filters
    publish on and on while the robot stands.
    """
    table = view.role("particles")
    frames = view.manifest.frames
    target = frames.map or "map"
    if table is None or not len(table):
        return None
    from slamreplay.estimators.amcl.cloud import moments  # loads numba

    table = table.take(np.array([clean_frame(f) == target for f in table["frame_id"].tolist()]))
    table = table.sorted_by_time()
    xyyaw, cov = np.full((len(table), 3), np.nan), np.full((len(table), 3, 3), np.nan)
    clouds = zip(table["xyyaw"], table["weights"], strict=True)
    for row, (numbers, given) in enumerate(clouds):
        particles = np.asarray(numbers, dtype=np.float64).reshape(-1, 3)
        weights = np.asarray(given, dtype=np.float64)
        if len(weights) != len(particles) or not (weights > 0.0).any():
            weights = np.ones(len(particles))
        good = np.isfinite(particles).all(axis=1) & np.isfinite(weights) & (weights >= 0.0)
        if good.sum() >= _FEWEST and weights[good].sum() > 0.0:
            said = moments(particles[good], weights[good])
            xyyaw[row], cov[row] = said.mean_xyyaw, said.cov
    same = (xyyaw[1:] == xyyaw[:-1]).all(axis=1) & (cov[1:] == cov[:-1]).all(axis=(1, 2))
    keep = is_positive_definite(cov) & np.append(True, ~same)[: len(cov)]
    if not keep.any():
        return None
    track = PoseTrack(target, frames.base or "base_link", table.t_ns, xyyaw, cov)
    return track.take(keep)
