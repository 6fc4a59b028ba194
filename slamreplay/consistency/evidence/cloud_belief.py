"""What a particle filter believed, where it recorded its particles and no covariance.

Many localizers tell their pose by tf alone. Their cloud is their belief all the same: its mean and
its covariance belong together by construction, and NEES may judge them.
"""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.consistency.evidence.clouds import clouds_in, sound_particles
from slamreplay.consistency.evidence.published import fresh_rows
from slamreplay.geometry.covariance import is_positive_definite

#: Fewer particles are a drawing, not a distribution.
_FEWEST = 20


def cloud_belief(view: BundleView) -> PoseTrack | None:
    """Mean and covariance of every cloud in the map's frame, base in map, sorted by time.

    None where no topic plays the role, or no cloud is of the map, has `_FEWEST` particles and a
    spread in every direction. A cloud that says the same as the one before is left out: filters
    publish on and on while the robot stands.
    """
    frames = view.manifest.frames
    target = frames.map or "map"
    table = clouds_in(view, target)
    if table is None:
        return None
    from slamreplay.estimators.amcl.cloud import moments  # loads numba

    xyyaw, cov = np.full((len(table), 3), np.nan), np.full((len(table), 3, 3), np.nan)
    clouds = zip(table["xyyaw"], table["weights"], strict=True)
    for row, cloud in enumerate(clouds):
        particles, weights = sound_particles(*cloud)
        if len(particles) >= _FEWEST:
            said = moments(particles, weights)
            xyyaw[row], cov[row] = said.mean_xyyaw, said.cov
    track = PoseTrack(target, frames.base or "base_link", table.t_ns, xyyaw, cov)
    track = fresh_rows(track.take(is_positive_definite(cov)))
    return track if len(track) else None
