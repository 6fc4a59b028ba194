"""One incident: made, labelled, judged, and asked for its root cause."""

from __future__ import annotations

from collections.abc import Sequence
from time import process_time
from typing import Any

from slamreplay.bench.cause_answers import ANSWERERS, JudgedLog
from slamreplay.bench.incidents import incident
from slamreplay.bench.known_cause import known_cause
from slamreplay.bench.logs import bundle_of
from slamreplay.bench.measure import Measured
from slamreplay.bench.schedule import Case
from slamreplay.bundle.belief import belief_times, recorded_belief
from slamreplay.hindsight.pipeline import hindsight
from slamreplay.verdict.judge import judge


def measured_cause(case: Case, answerers: Sequence[str]) -> Measured:
    """Play a case; the facts hold its label, its state and what each answerer said.

    Args:
        case: of the schedule.
        answerers: names in `ANSWERERS`.
    """
    made = incident(case.kind, case.seed, case.conditions)
    bundle, truth = bundle_of(made)
    known = known_cause(made, truth)
    view = bundle.view()
    found = hindsight(view)
    belief = recorded_belief(view, belief_times(view))
    log = JudgedLog(view, belief, found, judge(view, belief, found))
    said: dict[str, Any] = {}
    for name in answerers:
        since = process_time()
        answer = ANSWERERS[name](log)
        said[name] = {
            "kind": answer.kind,
            "probability": answer.probability,
            "ranked": [[kind, p] for kind, p in answer.ranked],
            "trials": answer.trials,
            "cpu_s": round(process_time() - since, 2),
            "text": answer.text,
        }
    facts = {
        "state": truth.state,
        "judged": log.judgement.state,
        "happened": known.happened,
        "accepted": list(known.accepted),
        "done": list(known.done),
        "label": known.label,
        "said": said,
    }
    return Measured(case, facts)
