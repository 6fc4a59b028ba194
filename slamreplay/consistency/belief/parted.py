"""SR-CON-011: a mean of some particles published with the covariance of others."""

from __future__ import annotations

from slamreplay.bundle.findings import Finding, Severity
from slamreplay.consistency.context import CheckContext
from slamreplay.geometry.times import NS_PER_S

#: A few such rows come with every relocalization; beyond this share it is worth a warning.
SHARE = 0.05


def check(context: CheckContext) -> tuple[Finding, ...]:
    """One finding for all updates whose mean and covariance do not belong together."""
    found = context.belonging
    if found is None or not found.parted.any() or found.at_ns is None:
        return ()
    t_ns, start_ns = found.t_ns[found.parted], context.view.manifest.start_ns
    share = float(found.parted.sum() / found.seen.sum())
    severity: Severity = "warning" if share > SHARE else "info"
    first, last, example = (
        (t - start_ns) / NS_PER_S for t in (int(t_ns[0]), int(t_ns[-1]), found.at_ns)
    )
    rest = "all updates are" if found.refusal else "they are"
    text = f"{len(t_ns)} of {found.seen.sum()} updates, from {first:.1f} to {last:.1f} s, have the "
    text += f"mean of other particles than the covariance: at {example:.1f} s {found.words}; "
    text += f"{rest} left out of NEES"
    return (
        Finding(
            "SR-CON-011",
            severity,
            text,
            start_ns=int(t_ns[0]),
            end_ns=int(t_ns[-1]),
            value=share,
            unit="ratio",
            n=int(found.seen.sum()),
        ),
    )
