"""Normalised estimation error squared of a planar belief against a reference.

e' (P + P_ref)^-1 e with e = belief minus reference in x, y and wrapped yaw, axes of the parent
frame, as ROS gives the covariance (Bar-Shalom, Li, Kirubarajan 2001, section 5.4.2). Nothing is
aligned first: an alignment would eat the error that is to be judged.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.evidence.nees_summary import NeesSummary
from slamreplay.consistency.evidence.parts import POSE, Part
from slamreplay.consistency.statistics.mean_test import mean_test
from slamreplay.consistency.statistics.whitening import whitened
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import ANY_ANGLE
from slamreplay.geometry.transforms import clean_frame

#: A reference is interpolated between samples no farther apart than this.
MAX_GAP_NS = 500_000_000


@dataclass(frozen=True, eq=False)
class Nees:
    """NEES row by row, on the rows of the belief in time order.

    Attributes:
        t_ns: (N,) times.
        error: (N, 3) belief minus reference, m, m, rad; NaN where either is missing.
        cov: (N, 3, 3) the belief's plus the reference's own, in the same axes; NaN where the error
            is not to be held against it.
        invalid: rows without a joint value, counted by reason.
        refusal: why nothing could be compared, None where it could.
    """

    t_ns: NDArray[np.int64]
    error: se2.Array
    cov: se2.Array
    invalid: Mapping[str, int]
    refusal: str | None = None

    @cached_property
    def joint(self) -> se2.Array:
        """(N,) NEES of x y yaw, NaN where invalid."""
        return self.squared(POSE)

    def squared(self, part: Part) -> se2.Array:
        """(N,) NEES of one part."""
        return np.asarray(np.sum(part.white(self) ** 2, axis=1))

    def summary(self, part: Part = POSE) -> NeesSummary:
        """The mean of one part against its interval."""
        return NeesSummary(f"the {part.name}", mean_test(part.white(self)))


def nees(
    estimate: PoseTrack,
    reference: PoseTrack,
    max_gap_ns: int = MAX_GAP_NS,
    left_out: NDArray[np.bool_] | None = None,
) -> Nees:
    """NEES of a belief at its own rows, the reference interpolated between its samples.

    The reference's covariance is added where it is finite; of a reference without heading only
    `xy` is given, and where the belief's heading may be any. Two tracks in different frames are
    refused, not aligned: every row is invalid then and `refusal` says why.

    Args:
        estimate: the belief, one row per update: a covariance that was merely held from the update
            before would count the same evidence again.
        reference: the independent pose of the same frame of the robot, in the same parent frame.
        max_gap_ns: rows between two reference samples farther apart than this stay invalid.
        left_out: (N,) rows of the estimate whose mean and covariance do not belong together.
    """
    order = np.argsort(estimate.t_ns, kind="stable")
    estimate = estimate.take(order)
    truth = _at(reference, estimate.t_ns, max_gap_ns)
    error = estimate.xyyaw - truth.xyyaw
    error[:, 2] = se2.wrap_angle(error[:, 2])
    refusal = None
    if clean_frame(estimate.frame_id) != clean_frame(reference.frame_id):
        refusal = (
            f"the belief is in frame '{estimate.frame_id}', the reference in "
            f"'{reference.frame_id}', and nothing independent of the belief ties them"
        )
        error = np.full_like(error, np.nan)
    cov = estimate.cov + np.where(np.isfinite(truth.cov), truth.cov, 0.0)
    left_out = np.zeros(len(order), dtype=bool) if left_out is None else left_out[order]
    cov[left_out] = np.nan
    with np.errstate(invalid="ignore"):
        headless = estimate.cov[:, 2, 2] > ANY_ANGLE
    cov[headless, 2, :] = cov[headless, :, 2] = np.nan
    joint = np.sum(whitened(error, cov) ** 2, axis=1)
    reasons = {
        "frames differ": np.full(len(estimate), refusal is not None),
        "no belief": ~estimate.has_pose,
        "mean and covariance of different particles": left_out,
        "no reference": ~np.isfinite(error[:, :2]).all(axis=1),
        "no heading known (any would do)": headless,
        "no reference heading": ~np.isfinite(error[:, 2]),
        "no covariance": ~np.isfinite(cov).all(axis=(1, 2)),
        "covariance not positive definite": ~np.isfinite(joint),
    }
    invalid, left = {}, np.ones(len(estimate), dtype=bool)
    for reason, rows in reasons.items():  # each row counts once, under its first reason
        if (left & rows).any():
            invalid[reason] = int((left & rows).sum())
        left &= ~rows
    return Nees(estimate.t_ns, error, cov, invalid, refusal)


def _at(reference: PoseTrack, t_ns: NDArray[np.int64], max_gap_ns: int) -> PoseTrack:
    """The reference at times (M,); one without any heading gives its position all the same."""
    headless = ~np.isfinite(reference.xyyaw[:, 2]).any()
    if not headless:
        return reference.at(t_ns, max_gap_ns)
    xyyaw = reference.xyyaw.copy()
    xyyaw[:, 2] = 0.0
    there = PoseTrack(
        reference.frame_id, reference.child_frame_id, reference.t_ns, xyyaw, reference.cov
    ).at(t_ns, max_gap_ns)
    xyyaw = there.xyyaw.copy()
    xyyaw[:, 2] = np.nan
    return PoseTrack(there.frame_id, there.child_frame_id, there.t_ns, xyyaw, there.cov)
