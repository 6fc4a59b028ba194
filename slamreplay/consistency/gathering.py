"""What a belief can be held against: one `Evidence` for each source in the log."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.consistency.evidence import Evidence, Reference
from slamreplay.consistency.nees import nees
from slamreplay.consistency.published import fresh_rows, published_belief
from slamreplay.geometry.se2 import Array


def updates_of(
    belief: PoseTrack | None, view: BundleView, subject: str, diagnostics: Mapping[str, Array]
) -> PoseTrack | None:
    """The rows of a belief at which it was updated, sorted by time; None without a covariance.

    Of the robot's own localizer those it published with a covariance, else those at which the
    covariance changed; of an estimator those it marks as `updated`.
    """
    if not subject:
        published = published_belief(view)
        if published is not None:
            return published
    if belief is None:
        return None
    if "updated" in diagnostics:
        belief = belief.take(diagnostics["updated"] > 0.0)
    fresh = fresh_rows(belief)
    order = np.argsort(fresh.t_ns, kind="stable")
    return fresh.take(order) if len(fresh) else None


def evidence_of(
    updates: PoseTrack,
    references: tuple[Reference, ...],
    left_out: NDArray[np.bool_] | None = None,
) -> tuple[Evidence, ...]:
    """The errors of the updates (N rows) against every source, the best first.

    Those of rows (N,) that are left out are NaN: their mean and covariance part.
    """
    return tuple(_against(updates, reference, left_out) for reference in references)


def _against(
    updates: PoseTrack, reference: Reference, left_out: NDArray[np.bool_] | None
) -> Evidence:
    result = nees(updates, reference.track, left_out=left_out)
    words = reference.kind.replace("_", " ")
    source = words if reference.source == reference.kind else f"{words} {reference.source}"
    axes = ("x m", "y m", "yaw rad")
    return Evidence(source, reference.kind, result.t_ns, result.error, result.cov, axes)
