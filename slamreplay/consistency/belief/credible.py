"""SR-CON-005: is the covariance credible in every direction?"""

from __future__ import annotations

from slamreplay.bundle.findings import Finding
from slamreplay.consistency.answers import P_ACCUSE, Suspicion
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence.parts import exact_parts
from slamreplay.consistency.statistics.credibility_index import CredibilityIndex, credibility_index

#: A factor of 2 in the variance: beyond it a covariance misleads.
LARGE_DB = 3.0


def check(context: CheckContext) -> tuple[Suspicion, ...]:
    """SR-CON-005 from the best source; that there are too few samples is said by SR-CON-003.

    A single axis has one direction only, which SR-CON-001 judges.
    """
    answers = []
    for evidence, part in exact_parts(context.evidence, context.updates):
        found = credibility_index(part.white(evidence)) if len(part.axes) > 1 else None
        if found is None or not found.sufficient:
            continue
        large = found.nci >= LARGE_DB and found.p_direction < P_ACCUSE
        finding = Finding(
            "SR-CON-005",
            "warning" if large else "info",
            f"{sentence(found, part.name)}, against {evidence.source}",
            start_ns=int(evidence.t_ns[0]),
            end_ns=int(evidence.t_ns[-1]),
            value=found.nci,
            low=0.0,
            high=LARGE_DB,
            unit="dB",
            n=found.n,
            n_eff=found.n_eff,
        )
        answers.append(Suspicion(finding, found.p_value))
    return tuple(answers)


def sentence(found: CredibilityIndex, name: str) -> str:
    """The two indices, and whether one factor on sigma would mend them."""
    side = "too small" if found.inclination > 0.0 else "too large"
    text = (
        f"the covariance of the {name} is not credible: noncredibility index {found.nci:.1f} dB, "
        f"inclination {found.inclination:+.1f} dB, {side} on the whole"
    )
    if found.p_direction >= P_ACCUSE:
        return f"{text}; the same factor in every direction"
    low, high = found.worst
    return (
        f"{text}; not by one factor: the errors are {low:.2g} times the claimed sigma in one "
        f"direction and {high:.2g} times in another"
    )
