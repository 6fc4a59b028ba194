"""Questions put to a belief: is it as good as it says, and is the evidence whole?"""

from slamreplay.registry import Registry

CHECKS = Registry(
    "check",
    {
        "clock": "slamreplay.consistency.clock:check",
        "covariance": "slamreplay.consistency.validity:check",
        "losses": "slamreplay.consistency.completeness:check_losses",
        "missing": "slamreplay.consistency.completeness:check_missing",
        "nees": "slamreplay.consistency.credibility:check",
    },
)
