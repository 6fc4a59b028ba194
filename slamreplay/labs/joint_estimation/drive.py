"""Laps round a yard with landmarks, and what odometry and a range finder make of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.geometry import se2
from slamreplay.graph.landmarks import Evidence

#: Half of the yard's ways, m; landmarks stand within a margin of them.
_HALF_M, _MARGIN_M = (9.0, 6.0), 3.0
#: Nearer than that nothing is seen: there a bearing says more than any sensor can, m.
_NEAREST_M = 0.5


@dataclass(frozen=True)
class Noise:
    """Standard deviations of what the robot senses.

    Attributes:
        step_m: of odometry, along and across, after one metre.
        turn_rad: of its heading after one metre.
        range_m: of a range to a landmark.
        bearing_rad: of its bearing.
    """

    step_m: float
    turn_rad: float
    range_m: float
    bearing_rad: float


@dataclass(frozen=True, eq=False)
class Drive:
    """One log: truth (K, 3) and (L, 2), what was measured, and odometry (K, 3) from the start."""

    xyyaw: se2.Array
    landmarks: se2.Array
    evidence: Evidence
    odometry: se2.Array


def drive(
    length_m: float, step_m: float, landmarks: int, reach_m: float, noise: Noise,
    rng: np.random.Generator,
) -> Drive:  # fmt: skip
    """Drive so far round an ellipse and see every landmark within reach at every step."""
    true = _path(length_m, step_m)
    low = -np.array(_HALF_M) - _MARGIN_M
    places = rng.uniform(low, -low, (landmarks, 2))
    motions = se2.between(true[:-1], true[1:])
    sigma = np.array([noise.step_m, noise.step_m, noise.turn_rad]) * np.sqrt(step_m)
    measured = motions + sigma * rng.standard_normal(motions.shape)
    each = np.broadcast_to(places, (len(true), *places.shape))
    local = se2.transform_points(se2.inverse(true), each)
    reach = np.hypot(local[..., 0], local[..., 1])
    pose_index, landmark = np.nonzero((reach >= _NEAREST_M) & (reach <= reach_m))
    seen, landmark = np.unique(landmark, return_inverse=True)
    at = local[pose_index, seen[landmark]]
    errors = rng.standard_normal((2, len(at)))
    evidence = Evidence(
        measured,
        np.broadcast_to(np.diag(sigma**2), (len(motions), 3, 3)).copy(),
        pose_index,
        landmark,
        se2.wrap_angle(np.arctan2(at[:, 1], at[:, 0]) + noise.bearing_rad * errors[0]),
        np.maximum(np.hypot(at[:, 0], at[:, 1]) + noise.range_m * errors[1], 0.1 * _NEAREST_M),
        noise.bearing_rad,
        noise.range_m,
    )
    odometry = np.empty_like(true)
    odometry[0] = true[0]
    for k, step in enumerate(measured):
        odometry[k + 1] = se2.compose(odometry[k], step)
    return Drive(true, places[seen], evidence, odometry)


def first_guess(evidence: Evidence, xyyaw: se2.Array) -> se2.Array:
    """(L, 2) each landmark where its first sighting puts it, seen from poses (K, 3)."""
    _, first = np.unique(evidence.landmark, return_index=True)
    at = evidence.reach[first, None] * np.column_stack(
        [np.cos(evidence.bearing[first]), np.sin(evidence.bearing[first])]
    )
    return se2.transform_points(xyyaw[evidence.pose_index[first]], at[:, None])[:, 0]


def _path(length_m: float, step_m: float) -> se2.Array:
    laps = np.linspace(0.0, 40.0 * np.pi, 80_001)
    x, y = _HALF_M[0] * np.cos(laps), _HALF_M[1] * np.sin(laps)
    way = np.append(0.0, np.cumsum(np.hypot(np.diff(x), np.diff(y))))
    angle = np.interp(np.arange(0.0, length_m + 0.5 * step_m, step_m), way, laps)
    heading = np.arctan2(_HALF_M[1] * np.cos(angle), -_HALF_M[0] * np.sin(angle))
    return np.column_stack([_HALF_M[0] * np.cos(angle), _HALF_M[1] * np.sin(angle), heading])
