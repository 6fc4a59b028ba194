"""Questions put to a belief: is it as good as it says, and is the evidence whole?"""

from slamreplay.registry import Registry

CHECKS = Registry(
    "check",
    {
        "belonging": "slamreplay.consistency.parted:check",
        "clock": "slamreplay.consistency.clock:check",
        "collapse": "slamreplay.consistency.collapse.check:check",
        "covariance": "slamreplay.consistency.validity:check",
        "credibility_index": "slamreplay.consistency.credible:check",
        "distribution": "slamreplay.consistency.shape:check",
        "innovation_bias": "slamreplay.consistency.innovation_bias:check",
        "lasers": "slamreplay.consistency.lasers:check",
        "losses": "slamreplay.consistency.completeness:check_losses",
        "missing": "slamreplay.consistency.completeness:check_missing",
        "nees": "slamreplay.consistency.credibility:check",
        "nis": "slamreplay.consistency.nis:check",
        "numbers": "slamreplay.consistency.numbers:check",
        "scan_likelihood": "slamreplay.consistency.scan_likelihood:check",
        "stamps": "slamreplay.consistency.stamps:check",
        "tf_steps": "slamreplay.consistency.tf_steps:check",
        "tf_times": "slamreplay.consistency.tf_times:check",
        "tf_tree": "slamreplay.consistency.tf_tree:check",
        "whiteness": "slamreplay.consistency.whiteness:check",
    },
)

#: The checks that need neither a belief nor hindsight: `slamreplay inspect` asks them too.
AUDITS = (
    "clock",
    "stamps",
    "tf_tree",
    "tf_times",
    "tf_steps",
    "covariance",
    "numbers",
    "lasers",
)

#: The checks that concern a belief, whoever holds it: runs of estimators are asked them too.
ABOUT_BELIEF = frozenset(
    {
        "belonging",
        "collapse",
        "credibility_index",
        "distribution",
        "innovation_bias",
        "nees",
        "nis",
        "scan_likelihood",
        "whiteness",
    }
)
