"""SR-CON-004: are the errors distributed as the covariance says?"""

from __future__ import annotations

from slamreplay.bundle.findings import Finding
from slamreplay.consistency.answers import Suspicion
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence.parts import exact_parts
from slamreplay.consistency.statistics.distribution import LEVELS, WILD, Distribution, distribution

#: The shape is off below this `p_shape`, which rather exceeds the true one: of independent
#: consistent errors 1 to 3 % fall below.
SHAPE_OFF = 0.1


def check(context: CheckContext) -> tuple[Suspicion, ...]:
    """SR-CON-004 from the best source; that there are too few samples is said by SR-CON-003."""
    answers = []
    for evidence, part in exact_parts(context.evidence, context.updates):
        found = distribution(part.white(evidence))
        if found is None or not found.sufficient:
            continue
        finding = Finding(
            "SR-CON-004",
            "warning" if found.p_shape < SHAPE_OFF else "info",
            f"{sentence(found, part.name)}, against {evidence.source}",
            start_ns=int(evidence.t_ns[0]),
            end_ns=int(evidence.t_ns[-1]),
            value=found.distance,
            low=0.0,
            high=found.most,
            unit="1",
            n=found.n,
            n_eff=found.n_eff,
        )
        answers.append(Suspicion(finding, found.p_value))
    return tuple(answers)


def sentence(found: Distribution, name: str) -> str:
    """How many errors the ellipses hold, and whether scale or shape is at fault."""
    claims = zip(LEVELS, found.coverage, strict=True)
    held = ", ".join(f"{100 * level:.0f} %: {100 * share:.0f} %" for level, share in claims)
    text = f"the {name}'s ellipses hold other shares of the errors than they claim ({held})"
    if found.p_shape >= SHAPE_OFF:
        return f"{text}; only the scale is at fault: one factor on sigma mends all of them"
    numbers = (
        f"with sigma scaled right {100 * found.wild:.1f} % of the errors lie beyond the "
        f"{100 * WILD:.0f} % ellipse, and their squares spread {found.dispersion:.2g} times as "
        "much as they should"
    )
    if found.dispersion > 1.0:
        return f"{text}; the shape is off, whatever the scale: a few errors are wild ({numbers})"
    return (
        f"{text}; the shape is off, whatever the scale: the errors are too much alike in size, as "
        f"a constant offset makes them ({numbers})"
    )
