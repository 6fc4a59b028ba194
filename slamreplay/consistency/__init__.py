"""Questions put to a belief: is it as good as it says, and is the evidence whole?"""

from slamreplay.registry import Registry

CHECKS = Registry(
    "check",
    {
        "belonging": "slamreplay.consistency.belief.parted:check",
        "clock": "slamreplay.consistency.audits.clock:check",
        "collapse": "slamreplay.consistency.belief.collapse.check:check",
        "covariance": "slamreplay.consistency.belief.validity:check",
        "credibility_index": "slamreplay.consistency.belief.credible:check",
        "distribution": "slamreplay.consistency.belief.shape:check",
        "innovation_bias": "slamreplay.consistency.innovations.innovation_bias:check",
        "jumps": "slamreplay.consistency.belief.jumps.check:check",
        "lasers": "slamreplay.consistency.audits.lasers:check",
        "losses": "slamreplay.consistency.audits.completeness:check_losses",
        "missing": "slamreplay.consistency.audits.completeness:check_missing",
        "motion_units": "slamreplay.consistency.audits.motion_units:check",
        "nees": "slamreplay.consistency.belief.credibility:check",
        "nis": "slamreplay.consistency.innovations.nis:check",
        "numbers": "slamreplay.consistency.audits.numbers:check",
        "scan_likelihood": "slamreplay.consistency.innovations.scan_likelihood:check",
        "stamps": "slamreplay.consistency.audits.stamps:check",
        "tf_steps": "slamreplay.consistency.audits.tf_steps:check",
        "tf_times": "slamreplay.consistency.audits.tf_times:check",
        "tf_tree": "slamreplay.consistency.audits.tf_tree:check",
        "whiteness": "slamreplay.consistency.innovations.whiteness:check",
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
    "motion_units",
)

#: The checks that concern a belief, whoever holds it: runs of estimators are asked them too.
ABOUT_BELIEF = frozenset(
    {
        "belonging",
        "collapse",
        "credibility_index",
        "distribution",
        "innovation_bias",
        "jumps",
        "nees",
        "nis",
        "scan_likelihood",
        "whiteness",
    }
)
