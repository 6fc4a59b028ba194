"""SR-CON-002: published covariances that are none."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.findings import Finding, Severity
from slamreplay.consistency.context import CheckContext
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import is_positive_definite, planar_from_ros

#: So many identical covariances in a row are a constant somebody typed in, not an estimate.
PLACEHOLDER_ROWS = 20


def check(context: CheckContext) -> tuple[Finding, ...]:
    """Rows of the pose topic whose x y yaw block is no covariance, counted by defect."""
    table = context.view.role("covariance") or context.view.role("pose")
    if table is None or not len(table):
        return ()
    cov = planar_from_ros(table["covariance"])
    given = ~np.isnan(cov).all(axis=(1, 2))  # none given at all is a missing part, no defect
    if not given.any():
        return ()
    defects = _defects(cov[given])
    t = table.t_ns[given]
    findings = []
    for text, rows in defects.items():
        if not rows.any():
            continue
        share = float(rows.mean())
        severity: Severity = "warning" if share > 0.01 else "info"
        findings.append(
            Finding(
                "SR-CON-002",
                severity,
                f"{int(rows.sum())} of {len(rows)} published covariances are {text}",
                start_ns=int(t[rows].min()),
                end_ns=int(t[rows].max()),
                value=share,
                low=0.0,
                high=0.0,
                unit="ratio",
                n=len(rows),
            )
        )
    return tuple(findings)


def _defects(cov: se2.Array) -> dict[str, np.ndarray]:
    finite = np.isfinite(cov).all(axis=(1, 2))
    zero = (cov == 0.0).all(axis=(1, 2))
    sound = is_positive_definite(cov)
    constant = np.zeros(len(cov), dtype=bool)
    if len(cov) >= PLACEHOLDER_ROWS and (cov == cov[:1]).all() and sound.all():
        constant[:] = True
    return {
        "not finite": ~finite,
        "all zero": zero,
        "not symmetric and positive definite": finite & ~zero & ~sound,
        "one and the same constant: a placeholder, not an estimate": constant,
    }
