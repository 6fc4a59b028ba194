"""SR-CON-002: published covariances that are none."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.covariance_faults import CONSTANT, INDEFINITE
from slamreplay.bundle.findings import Finding, Severity
from slamreplay.bundle.placeholders import judge
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import BundleView
from slamreplay.consistency.context import CheckContext
from slamreplay.geometry.covariance import is_positive_definite, planar_from_ros


def check(context: CheckContext) -> tuple[Finding, ...]:
    """Rows of the pose topic whose x y yaw block is no covariance, counted by defect.

    The rows are read as they were recorded: in the view they are not given any more.
    """
    table = published_rows(context.view)
    if table is None or not len(table):
        return ()
    given = ~np.isnan(planar_from_ros(table["covariance"])).all(axis=(1, 2))
    if not given.any():  # none given at all is a missing part, no defect
        return ()
    t = table.t_ns[given]
    findings = []
    for text, rows in _defects(table.take(given), context.view.manifest.frames.map).items():
        if not rows.any():
            continue
        text += ": a placeholder, not an estimate" if text == CONSTANT else ""
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


def published_rows(view: BundleView) -> Table | None:
    """The rows of the topic that gives the belief's covariance, as they were recorded."""
    manifest = view.manifest
    topic = manifest.topic_of("covariance") or manifest.topic_of("pose")
    if topic is None:
        return None
    table = view.recorded("poses")
    return table.take(table["topic"] == topic)


def _defects(rows: Table, map_frame: str | None) -> dict[str, NDArray[np.bool_]]:
    faults = dict(judge(rows, "covariance", map_frame).faults)
    told = np.logical_or.reduce(list(faults.values()))
    # One without any spread in some direction is no placeholder, and no use to NEES either.
    flat = ~told & ~is_positive_definite(planar_from_ros(rows["covariance"]))
    faults[INDEFINITE] = faults[INDEFINITE] | flat
    return faults
