"""check_check: what every consistency check must meet.

from slamreplay.testing import check_check
check_check(my_check, "MY-001", lambda seed: my_context_with_the_defect(seed))
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from slamreplay.bundle.findings import Finding
from slamreplay.consistency.answers import Suspicion, raised
from slamreplay.consistency.context import CheckContext
from slamreplay.testing.beliefs import believed
from slamreplay.testing.conformance import demand, untouched_global_rng

Contexts = Callable[[int], CheckContext]


def check_check(
    check: Any,
    id_: str,
    defective: Contexts,
    *,
    consistent: Contexts = believed,
    seeds: int = 200,
    allowed: int = 2,
    tries: int = 20,
    found: int = 19,
) -> None:
    """Raise ConformanceError at the first part of the contract that the check breaks.

    It answers with findings and suspicions, the same ones when asked again, without random numbers
    of others; it accuses sound data hardly ever, and finds the defect that it is there for.

    Args:
        check: a function of a CheckContext.
        id_: of the finding that names the defect.
        defective: by seed, a log that has it.
        consistent: by seed, a log without any.
        seeds: how many sound logs are tried.
        allowed: warnings and errors on all of them together.
        tries: how many logs with the defect are tried.
        found: in so many of them it must be named.
    """
    name = getattr(check, "__module__", repr(check))
    accused: list[Finding] = []
    for seed in range(seeds):
        context = consistent(seed)
        with untouched_global_rng(name):
            answers = check(context)
        demand(
            all(isinstance(a, Finding | Suspicion) for a in answers),
            f"{name} answers with something else than findings and suspicions",
        )
        if not seed:
            demand(
                tuple(check(context)) == tuple(answers),
                f"{name} answers otherwise when asked again",
            )
        accused += [f for f in raised(tuple(answers)) if f.severity != "info"]
    told = "; ".join(f"{f.id} {f.message}" for f in accused[:3])
    demand(
        len(accused) <= allowed, f"{name} accuses {seeds} sound logs {len(accused)} times: {told}"
    )
    hits = sum(
        any(f.id == id_ and f.severity != "info" for f in raised(tuple(check(defective(seed)))))
        for seed in range(tries)
    )
    demand(hits >= found, f"{name} names {id_} in {hits} of {tries} logs that have it")
