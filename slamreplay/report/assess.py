"""Which questions this log could be asked at all."""

from __future__ import annotations

from slamreplay.bundle.findings import FINDINGS
from slamreplay.consistency.evidence.parts import HEADING, POSE, POSITION
from slamreplay.consistency.evidence.source import SHARED_KINDS
from slamreplay.evidence.result import Postmortem
from slamreplay.verdict.judgement import UNDECIDED

_NEEDS_BELIEF = ("SR-LOC-001", "SR-MAP-FRAME", "SR-CON-001", "SR-CON-002")
_NEEDS_HINDSIGHT = ("SR-LOC-001", "SR-LOC-002", "SR-MAP-001", "SR-MAP-FRAME", "SR-MAP-WRONG")


def not_assessable(post: Postmortem) -> dict[str, str]:
    """Finding ids that could not be looked for, each with the reason."""
    reasons: dict[str, str] = {}
    if post.hindsight is None:
        lacks = "no map" if post.grid is None else "no scans"
        why = f"{lacks}: where the robot really was cannot be rebuilt"
        reasons |= dict.fromkeys(_NEEDS_HINDSIGHT, why)
    if post.belief is None or not post.belief.has_pose.any():
        reasons |= dict.fromkeys(_NEEDS_BELIEF, "no localizer spoke: there is no belief to judge")
    elif post.nees is None and "SR-CON-001" not in reasons:
        lacks = "no reference" if post.reference is None else "no covariance"
        reasons["SR-CON-001"] = f"{lacks} to measure the belief's errors against"
    runs = tuple(f"{result.run.trial.estimator}: " for result in post.trials)
    undecided = [
        f for f in post.findings if f.id == "SR-CON-003" and not f.message.startswith(runs)
    ]
    if undecided and not _decided(post):
        reasons.setdefault("SR-CON-001", undecided[0].message)
    if post.judgement.state in UNDECIDED:
        for id_ in ("SR-LOC-001", "SR-MAP-001", "SR-MAP-FRAME"):
            reasons.setdefault(id_, post.judgement.summary.rstrip("."))
    answered = {finding.id for finding in post.findings}
    return {id_: why for id_, why in reasons.items() if id_ not in answered}


def _decided(post: Postmortem) -> bool:
    """Whether a reference of its own told of the covariance, whatever another one could not."""
    if post.nees is None or post.reference_kind in SHARED_KINDS:
        return False
    parts = (POSE, POSITION, HEADING)
    return any(post.nees.summary(part).credibility != "insufficient" for part in parts)


def title_of(id_: str) -> str:
    """A finding's short name; checks of other packages may use ids of their own."""
    return FINDINGS[id_].title if id_ in FINDINGS else id_
