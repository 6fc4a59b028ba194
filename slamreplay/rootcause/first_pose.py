"""The pose that a stretch of a log begins with: told, and whether that was right."""

from __future__ import annotations

import numpy as np

from slamreplay.estimators.start import DEFAULT_COV
from slamreplay.geometry import se2
from slamreplay.rootcause.incident import Incident

#: A start that hindsight gives is told as a careful person would click it: m, m, rad.
START_COV = np.diag([0.15, 0.15, np.radians(5.0)]) ** 2
#: One that was told within this is as right as it gets; one that its covariance says is worse known
#: than by so many metres beyond the habit is vague.
_RIGHT_M, _RIGHT_RAD, WIDE_M = 0.4, np.radians(12.0), 0.5


def first_told(
    incident: Incident, truth: se2.Array
) -> tuple[se2.Array, se2.Array, se2.Array] | None:
    """The first pose (3,), its covariance (3, 3), and how far off it is (3,); None without any.

    The pose is moved to the first row, where hindsight (N, 3) has the robot move before.
    """
    rows = np.flatnonzero(np.isfinite(incident.belief).all(axis=1))
    if not len(rows):
        return None
    first = int(rows[0])
    pose = se2.compose(incident.belief[first], se2.between(truth[first], truth[0]))
    off = pose - truth[0]
    off[2] = se2.wrap_angle(off[2])
    cov = incident.cov[first]
    sound = np.isfinite(cov).all() and np.linalg.eigvalsh(cov)[0] >= 0.0 and cov[0, 0] > 0.0
    return pose, cov if sound else START_COV, off


def right_start(incident: Incident, truth: se2.Array) -> tuple[se2.Array, se2.Array]:
    """Pose (3,) and covariance (3, 3) with nothing wrong: as told where that was right."""
    told = first_told(incident, truth)
    if told is not None:
        pose, cov, off = told
        vague = np.linalg.eigvalsh(wider(cov)[:2, :2])[-1] > WIDE_M**2
        if np.hypot(off[0], off[1]) <= _RIGHT_M and abs(off[2]) <= _RIGHT_RAD and not vague:
            return pose, cov
    return truth[0], START_COV


def wider(cov: se2.Array) -> se2.Array:
    """What a covariance (3, 3) has beyond the one that is sent by habit and says nothing."""
    values, vectors = np.linalg.eigh(cov - DEFAULT_COV)
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)
