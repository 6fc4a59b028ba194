"""SR-DAT-001 and SR-DAT-002: which evidence is missing, and what was lost while reading."""

from __future__ import annotations

from slamreplay.bundle.findings import Finding
from slamreplay.consistency.context import CheckContext

#: Without these the question of the verdict cannot be answered in full.
ESSENTIAL = frozenset({"odometry", "scans", "pose", "map"})

#: So many kinds of loss are spelt out; all of them are in the manifest.
WORST = 5


def check_missing(context: CheckContext) -> tuple[Finding, ...]:
    """One finding for each missing part of the replay bundle, with what that costs."""
    return tuple(
        Finding(
            "SR-DAT-001",
            "warning" if missing.part in ESSENTIAL else "info",
            f"{missing.part} is missing ({missing.reason}): {missing.consequence}",
        )
        for missing in context.view.manifest.missing
    )


def check_losses(context: CheckContext) -> tuple[Finding, ...]:
    """One finding for what was lost, one for what was mended; things skipped on purpose are none.

    The count is of everything the manifest lists under that kind.
    """
    findings = []
    for kind in ("lost", "repaired"):
        losses = [loss for loss in context.view.manifest.losses if loss.kind == kind]
        if not losses:
            continue
        losses.sort(key=lambda loss: -loss.count)
        text = "; ".join(f"{loss.count} {loss.what}: {loss.reason}" for loss in losses[:WORST])
        text += f"; and {len(losses) - WORST} more kinds" if len(losses) > WORST else ""
        total = sum(loss.count for loss in losses)
        findings.append(
            Finding(
                "SR-DAT-002",
                "warning" if kind == "lost" else "info",
                f"{kind} while reading: {text}",
                value=float(total),
                unit="1",
                n=total,
            )
        )
    return tuple(findings)
