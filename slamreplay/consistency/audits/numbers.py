"""SR-DAT-003 and 004: numbers that stand where nothing was measured, and numbers that are none."""

from __future__ import annotations

from collections.abc import Iterable

from slamreplay.audit.log_audit import LogAudit
from slamreplay.audit.numbers import OddNumbers
from slamreplay.bundle.covariance_faults import NOT_FINITE, NOT_GIVEN
from slamreplay.bundle.findings import Finding, Severity
from slamreplay.bundle.placeholders import FROZEN
from slamreplay.consistency.context import CheckContext

#: Beyond this share of a topic's rows it is worth a warning.
SHARE = 0.01


def check(context: CheckContext) -> tuple[Finding, ...]:
    """One finding for each topic with placeholders, and one for each with numbers that are none.

    The covariances of the belief itself are SR-CON-002's.
    """
    audit = context.audit
    manifest = audit.view.manifest
    belief = manifest.topic_of("covariance") or manifest.topic_of("pose")
    odd = [o for o in audit.odd_numbers if (o.table, o.topic) != ("poses", belief)]
    return (*_placeholders(audit, odd), *_none(odd))


def _placeholders(audit: LogAudit, odd: list[OddNumbers]) -> Iterable[Finding]:
    told = [o for o in odd if o.fault != NOT_FINITE]
    witnesses = {audit.view.manifest.topic_of("imu")}
    for topic in dict.fromkeys(o.topic for o in told):
        own = [o for o in told if o.topic == topic]
        # A gyro that says nothing would witness that the robot never turned.
        dead = [o for o in own if o.fault == FROZEN and o.column == "angular_velocity_xyz"]
        severity: Severity = "warning" if dead and topic in witnesses else "info"
        text = "; ".join(f"{o.column} {o.fault} in {o.rows} of {o.n}" for o in own)
        only = {o.fault for o in own} == {NOT_GIVEN}
        text = f"{topic}: {text}" + ("" if only else ": read as not given")
        yield _finding("SR-DAT-003", severity, text, own)


def _none(odd: list[OddNumbers]) -> Iterable[Finding]:
    told = [o for o in odd if o.fault == NOT_FINITE]
    for topic in dict.fromkeys(o.topic for o in told):
        own = [o for o in told if o.topic == topic]
        grave = any(o.rows > SHARE * o.n and "covariance" not in o.column for o in own)
        text = "; ".join(f"{o.column} in {o.rows} of {o.n}" for o in own)
        severity: Severity = "warning" if grave else "info"
        yield _finding("SR-DAT-004", severity, f"{topic}: numbers that are none: {text}", own)


def _finding(id_: str, severity: Severity, text: str, own: list[OddNumbers]) -> Finding:
    start, end = min(o.start_ns for o in own), max(o.end_ns for o in own)
    rows = max(o.rows for o in own)
    return Finding(id_, severity, text, start, end, value=rows / own[0].n, unit="ratio", n=own[0].n)
