"""Lanes of a scene: one number each over time, at full resolution."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.special import chdtri

from slamreplay.consistency.evidence.parts import POSE, POSITION
from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.scene import Lane
from slamreplay.geometry import se2
from slamreplay.verdict.belief_error import explained_match

#: Share of the values of a consistent belief that lie below the limit of the NEES lane.
_BELOW = 0.99


def scene_lanes(post: Postmortem) -> tuple[Lane, ...]:
    """Those of which at least one value is known."""
    return tuple(lane for lane in _lanes(post) if np.isfinite(lane.values).any())


def _lanes(post: Postmortem) -> Iterator[Lane]:
    limits, error = post.limits, post.error
    if error is not None:
        t_ns = error.t_ns
        yield Lane("error_m", "Position error", "m", t_ns, error.distance_m, limits.position_m)
        heading, far = np.degrees(error.heading_rad), float(np.degrees(limits.yaw_rad))
        yield Lane("error_deg", "Heading error", "deg", t_ns, heading, far)
    if post.belief is not None:
        sigma = largest_sigma(post.belief.cov)
        yield Lane("sigma_m", "Sigma of position (largest)", "m", post.belief.t_ns, sigma, None)
    yield from _nees(post)
    if post.hindsight is not None:
        changes, track = post.hindsight.changes, post.hindsight.track
        if changes is not None:
            share, most = changes.changed_share, limits.changed_share
            yield Lane("changed_share", "Changed beams", "", changes.t_ns, share, most)
        match = explained_match(post.hindsight)
        known = np.isfinite(match).any()
        least = limits.match_ratio * float(np.nanmedian(match)) if known else None
        yield Lane("match", "Scan match of unchanged beams", "", track.t_ns, match, least)


def _nees(post: Postmortem) -> Iterator[Lane]:
    """Of the pose; of the position alone where no heading can be held against it."""
    if post.nees is None:
        return
    for part in (POSE, POSITION):
        values = post.nees.squared(part)
        if np.isfinite(values).any():
            dof = len(part.axes)
            title = f"NEES of the {part.name} ({dof} dof)"
            yield Lane("nees", title, "", post.nees.t_ns, values, float(chdtri(dof, 1.0 - _BELOW)))
            return


def largest_sigma(cov: se2.Array) -> se2.Array:
    """(N,) standard deviation of position in its worst direction, m; NaN where it is not known.

    Args:
        cov: (N, 3, 3) of x y yaw; NaN where the source gives none.
    """
    sigma = np.full(len(cov), np.nan)
    known = np.isfinite(cov[:, :2, :2]).all(axis=(1, 2))
    largest = np.linalg.eigvalsh(cov[known, :2, :2])[:, -1]
    sigma[known] = np.sqrt(np.where(largest >= 0.0, largest, np.nan))
    return sigma
