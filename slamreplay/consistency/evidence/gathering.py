"""What a belief can be held against: one `Evidence` for each source in the log."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.consistency.evidence.charging import charging
from slamreplay.consistency.evidence.cloud_belief import cloud_belief
from slamreplay.consistency.evidence.hindsight_size import inflated, measured_hindsight_size
from slamreplay.consistency.evidence.nees import MAX_GAP_NS, nees
from slamreplay.consistency.evidence.nees_spatial import spatial_belief, spatial_errors
from slamreplay.consistency.evidence.published import fresh_rows, published_belief
from slamreplay.consistency.evidence.satellites import satellites
from slamreplay.consistency.evidence.second_odometry import second_odometry
from slamreplay.consistency.evidence.sighted import sighted
from slamreplay.consistency.evidence.source import MAP_AXES, SPATIAL_AXES, Evidence, Reference
from slamreplay.consistency.evidence.spatial_track import SpatialTrack
from slamreplay.geometry.se2 import Array


def updates_of(
    belief: PoseTrack | None, view: BundleView, subject: str, diagnostics: Mapping[str, Array]
) -> PoseTrack | None:
    """The rows of a belief at which it was updated, sorted by time; None without a covariance.

    Of the robot's own localizer those it published with a covariance, else the clouds of its
    particles, else those at which the covariance changed; of an estimator those it marks as
    `updated`, and where it took nothing in all at which the covariance changed.
    """
    if not subject:
        published = published_belief(view) or cloud_belief(view)
        if published is not None:
            return published
    if belief is None:
        return None
    updated = diagnostics.get("updated")
    if updated is not None and (updated > 0.0).any():
        belief = belief.take(updated > 0.0)
    fresh = fresh_rows(belief)
    order = np.argsort(fresh.t_ns, kind="stable")
    return fresh.take(order) if len(fresh) else None


def evidence_of(
    updates: PoseTrack,
    references: tuple[Reference, ...],
    view: BundleView,
    used: Collection[str] = (),
    left_out: NDArray[np.bool_] | None = None,
) -> tuple[Evidence, ...]:
    """The errors of the updates (N rows) against every source that is not the belief's own.

    Independent ones first, the best of them first; then those that share evidence with the belief.

    Args:
        updates: see `updates_of`.
        references: poses of the base, the best first.
        view: the log; what was held out of hindsight judges the belief all the same.
        used: kinds of references that the belief is known to be made of: they say nothing of it.
        left_out: (N,) updates whose mean and covariance part: no error is held against them, and
            the covariances of those against a reference are NaN.
    """
    view = replace(view, held_out=frozenset())
    motion = odometry_track(view)
    spatial = spatial_belief(view, updates)
    found = [_against(updates, spatial, r, left_out) for r in references if not _is_fixes(r)]
    updates = updates if left_out is None else updates.take(~left_out)
    if len(updates):
        found += [*_if_any(satellites(updates, view, motion)), *sighted(updates, view, motion)]
    found = [e for e in found if e.kind not in used]
    if len(updates):
        found += _if_any(charging(updates, view, motion))
        found += second_odometry(updates, view, motion)
    return tuple(sorted(found, key=lambda e: (e.shared, bool(e.at_most))))


def _if_any(evidence: Evidence | None) -> tuple[Evidence, ...]:
    return () if evidence is None else (evidence,)


def _is_fixes(reference: Reference) -> bool:
    """Positions of one receiver err together, which `satellites` counts."""
    return reference.kind == "gnss" and not np.isfinite(reference.track.xyyaw[:, 2]).any()


def _against(
    updates: PoseTrack,
    spatial: SpatialTrack | None,
    reference: Reference,
    left_out: NDArray[np.bool_] | None,
) -> Evidence:
    words = reference.kind.replace("_", " ")
    source = words if reference.source == reference.kind else f"{words} {reference.source}"
    track, at_most, notes = reference.track, "", []
    if reference.kind == "hindsight":
        size = measured_hindsight_size()
        track, at_most, notes = inflated(track, size), "it shares the robot's scans", [size.words]
    result = nees(updates, track, left_out=left_out)
    if result.invalid:
        skipped = ", ".join(f"{count} {reason}" for reason, count in result.invalid.items())
        notes.append(f"left out: {skipped}")
    dof = 3 if np.isfinite(track.xyyaw[:, 2]).any() else 2
    error, cov, axes = result.error[:, :dof], result.cov[:, :dof, :dof], MAP_AXES[:dof]
    if spatial is not None and reference.spatial is not None and result.refusal is None:
        error, cov = spatial_errors(spatial, reference.spatial, MAX_GAP_NS)
        error[np.isnan(result.error[:, :2]).any(axis=1)] = np.nan  # as those that were left out
        axes = SPATIAL_AXES
    return Evidence(
        source,
        reference.kind,
        result.t_ns,
        error,
        cov,
        axes,
        at_most,
        "; ".join(notes),
        result.refusal or "",
    )
