"""The public conformance kit, and a small synthetic bundle for tests of any stage."""

from slamreplay.testing.beliefs import believed
from slamreplay.testing.checks import check_check
from slamreplay.testing.conformance import ConformanceError
from slamreplay.testing.decoders import check_decoder
from slamreplay.testing.estimators import check_estimator
from slamreplay.testing.matched import check_noise
from slamreplay.testing.perturbations import check_perturbation
from slamreplay.testing.synthetic import synthetic_bundle

__all__ = [
    "ConformanceError",
    "believed",
    "check_check",
    "check_decoder",
    "check_estimator",
    "check_noise",
    "check_perturbation",
    "synthetic_bundle",
]
