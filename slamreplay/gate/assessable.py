"""Which findings a log does not let be looked for: silence about those is no good news."""

from __future__ import annotations

from slamreplay.estimators import RECORDED
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
_OF_INNOVATIONS = ("SR-CON-006", "SR-CON-007", "SR-CON-008", "SR-CON-009")
_OF_ODOMETRY = ("SR-ODO-001", "SR-ODO-002", "SR-ODO-003")


def unasked(post: Postmortem, measures: Measures) -> dict[str, str]:
    """Ids of findings to the reason why they could not be looked for; none that was found."""
    reasons: dict[str, str] = {}
    for id_, name in _LIKE.items():
        if name in measures.missing:
            reasons[id_] = measures.missing[name]
    if "sigma_max_m" in measures.missing:
        reasons |= dict.fromkeys(_AGAINST_A_SOURCE, measures.missing["sigma_max_m"])
    elif not post.consistency:
        reasons |= dict.fromkeys(_AGAINST_A_SOURCE, "nothing to hold the belief's errors against")
    if not any(t.run.trial.estimator not in RECORDED for t in post.trials):
        why = "no estimator that predicts its measurements was run again"
        reasons |= dict.fromkeys(_OF_INNOVATIONS, why)
    if post.odometry is None:
        reasons |= dict.fromkeys(_OF_ODOMETRY, "no odometry")
    elif post.hindsight is None:
        reasons |= dict.fromkeys(_OF_ODOMETRY, "no hindsight to hold odometry against")
    reasons |= not_assessable(post)
    found = {finding.id for finding in post.findings}
    return {id_: why for id_, why in reasons.items() if id_ not in found}
