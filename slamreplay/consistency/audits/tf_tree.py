"""SR-TF-001, 002 and 006: is tf one tree, with one publisher of each edge, that sensors hang on?"""

from __future__ import annotations

from collections.abc import Iterable

from slamreplay.audit.log_audit import LogAudit
from slamreplay.audit.tf_tree import SAME, TreeFault
from slamreplay.bundle.findings import Finding, Severity
from slamreplay.bundle.scans import SCAN_ROLES
from slamreplay.consistency.audits.clock import listed
from slamreplay.consistency.context import CheckContext

_TITLES = {
    "second parent": "frames with two parents",
    "cycle": "cycles",
    "static and moving": "transforms told both as fixed and as moving",
    "several values": "fixed transforms told in different ways, of which the last holds",
    "leading slash": "frame names with a leading slash, which tf2 refuses",
}


def check(context: CheckContext) -> tuple[Finding, ...]:
    """Faults of the tree, edges with two tellings, frames that hang nowhere."""
    audit = context.audit
    return (*_faults(audit), *_disagreements(audit), *_loose(audit))


def _faults(audit: LogAudit) -> Iterable[Finding]:
    for kind, title in _TITLES.items():
        found = [f for f in audit.tree_faults if f.kind == kind]
        if found:
            found.sort(key=lambda f: -(f.apart or 0.0))
            grave = any(_matters(fault, audit) for fault in found)
            severity: Severity = "warning" if grave else "info"
            text = f"{title}: {listed([_words(f) for f in found])}"
            yield Finding("SR-TF-001", severity, text, n=sum(f.samples for f in found))


def _matters(fault: TreeFault, audit: LogAudit) -> bool:
    """Whether where the robot or its sensors are depends on it."""
    if fault.kind in ("second parent", "cycle"):
        return True
    parent, _, child = fault.what.partition(" -> ")
    return (parent, child) in audit.mounts and (fault.apart or 0.0) > SAME


def _words(fault: TreeFault) -> str:
    if fault.kind in ("second parent", "cycle"):
        return f"{fault.what} ({fault.text})"
    if fault.kind == "static and moving":
        differ = f"up to {fault.apart:.3f} m apart" if (fault.apart or 0.0) > SAME else "alike"
        return f"{fault.what} ({fault.text}; {differ})"
    if fault.kind == "several values":
        return f"{fault.what} ({fault.apart:.3f} m apart, a radian counted as a metre)"
    return f"{fault.what} {fault.samples} times"


def _disagreements(audit: LogAudit) -> Iterable[Finding]:
    for d in audit.disagreements:
        stamps = f", {d.same_stamp} times with one stamp" if d.same_stamp else ""
        text = (
            f"{d.edge[0]} -> {d.edge[1]} goes back and forth {d.times} times in {d.n} samples "
            f"between values {d.apart:.3f} m apart (a radian counted as a metre){stamps}: two "
            "publishers that disagree"
        )
        yield Finding("SR-TF-002", "warning", text, d.start_ns, d.end_ns, value=d.apart, unit="m",
                      n=d.n)  # fmt: skip


def _loose(audit: LogAudit) -> Iterable[Finding]:
    if not audit.loose_frames:
        return
    manifest = audit.view.manifest
    lasers = {manifest.topic_of(role) for role in SCAN_ROLES}
    has_tf = bool(audit.edges)
    for of_sensor in (True, False):
        found = [f for f in audit.loose_frames if f.of_sensor == of_sensor]
        if not found:
            continue
        names = [
            f"{f.frame} of {listed(list(f.topics))}" + ("" if f.on_tf else " (never on tf)")
            for f in found
        ]
        if of_sensor:
            why = "" if has_tf else ", for there is no tf in the log"
            text = f"sensors whose place on the robot is not known{why}: {listed(names)}; they are "
            text += "taken to sit at the base"
        else:
            text = f"frames that tf does not tie to the robot: {listed(names)}"
        grave = of_sensor and any(lasers & {*f.topics} for f in found)
        yield Finding("SR-TF-006", "warning" if grave else "info", text, n=len(found))
