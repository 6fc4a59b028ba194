"""Ratios by which a perturbation changes what an estimator is told; 1 leaves it as it is."""

from __future__ import annotations

from slamreplay.bundle.view import BundleView

#: Of the covariances of motion, Q, and of measurements, R; of the score below which a match is
#: none; of particles.
PROCESS_NOISE, MEASUREMENT_NOISE = "process_noise_scale", "measurement_noise_scale"
MIN_SCORE, PARTICLES = "min_score", "particle_count"


def scales_of(view: BundleView) -> tuple[float, float]:
    """Ratios of the covariances of motion and of measurements that a view asks for."""
    return view.settings.get(PROCESS_NOISE, 1.0), view.settings.get(MEASUREMENT_NOISE, 1.0)
