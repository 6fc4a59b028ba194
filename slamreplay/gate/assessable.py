"""Which findings a log does not let be looked for: silence about those is no good news."""

from __future__ import annotations

from slamreplay.evidence.result import Postmortem
from slamreplay.gate.measures import Measures
from slamreplay.report.assess import not_assessable

#: Findings that rest on what a number rests on, too.
_LIKE = {
    "SR-CON-001": "sigma_max_m",
    "SR-CON-002": "sigma_max_m",
    "SR-CON-010": "sigma_max_m",
    "SR-CON-011": "sigma_max_m",
    "SR-ACT-001": "risky_actions",
    "SR-ACT-002": "stops",
    "SR-ACT-004": "risky_actions",
    "SR-ACT-005": "needless_recoveries",
    "SR-LOC-005": "jumps",
}
_AGAINST_A_SOURCE = ("SR-CON-004", "SR-CON-005")
_OF_INNOVATIONS = ("SR-CON-006", "SR-CON-007", "SR-CON-008")
_OF_ODOMETRY = ("SR-ODO-001", "SR-ODO-002", "SR-ODO-003")


def unasked(post: Postmortem, measures: Measures) -> dict[str, str]:
    """Ids of findings to the reason why they could not be looked for, all of them.

    One that was found all the same was found: that comes first.
    """
    reasons: dict[str, str] = {}
    for id_, name in _LIKE.items():
        if name in measures.missing:
            reasons[id_] = measures.missing[name]
    if "sigma_max_m" in measures.missing:
        reasons |= dict.fromkeys(_AGAINST_A_SOURCE, measures.missing["sigma_max_m"])
    elif not post.consistency:
        reasons |= dict.fromkeys(_AGAINST_A_SOURCE, "nothing to hold the belief's errors against")
    estimates = [t.run.estimate for t in post.trials if t.run.estimate is not None]
    if not any(one.is_predicted for estimate in estimates for one in estimate.innovations):
        why = "no estimator that predicts its measurements was run again"
        reasons |= dict.fromkeys(_OF_INNOVATIONS, why)
    if not any("likelihood_quantile" in estimate.diagnostics for estimate in estimates):
        reasons["SR-CON-009"] = "no estimator that tells how likely its scans are was run again"
    if post.odometry is None:
        reasons |= dict.fromkeys(_OF_ODOMETRY, "no odometry")
    elif post.hindsight is None:
        reasons |= dict.fromkeys(_OF_ODOMETRY, "no hindsight to hold odometry against")
    return reasons | not_assessable(post)
