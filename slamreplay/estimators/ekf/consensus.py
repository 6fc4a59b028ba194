"""Where the robot is, from some sightings in a row and nothing before them.

Two things seen at known ranges and bearings fix a pose; a wrong barcode among them fixes a wrong
one. So every pair makes a hypothesis, the one that most sightings agree with is refined by
Gauss-Newton on these, and it only counts where no other place explains the sightings as well:
RANSAC (Fischler and Bolles 1981) over all pairs instead of random ones, for a window holds few.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from slamreplay.geometry import se2
from slamreplay.geometry.covariance import turned

#: Least sightings that must agree, and their least share of the window.
LEAST_AGREEING, LEAST_SHARE = 3, 0.6
#: A start that is less certain than this is none: m, rad.
_VAGUE_M, _VAGUE_RAD = 0.5, 0.3
#: Hypotheses that are refined, rounds of it, and where rounds end: m and rad.
_REFINED, _ROUNDS, _STILL = 8, 20, 1e-9
#: By how much (in squared sigmas) the best place must beat another one.
_MARGIN = 10.0
#: Sightings that disagree cost as much as one at this probability.
_GATE = float(chdtri(2, 1e-3))
_GATE_WITH_HEADING = float(chdtri(3, 1e-3))


@dataclass(frozen=True, eq=False)
class Window:
    """K sightings, seen from the base at the last of them.

    Attributes:
        points: (K, 2) where the things are, m.
        headings: (K,) how they are turned, rad; NaN where that is not sensed.
        cov: (K, 3, 3) of both, the motion up to the last sighting included.
        places: (K, 3) the things in the map.
        thing: (K,) which ones.
    """

    points: se2.Array
    headings: se2.Array
    cov: se2.Array
    places: se2.Array
    thing: NDArray[np.int64]

    @property
    def gates(self) -> se2.Array:
        """(K,) largest squared sigmas of a sighting that agrees."""
        return np.where(np.isfinite(self.headings), _GATE_WITH_HEADING, _GATE)


def window_of(
    polar: se2.Array,
    dims: NDArray[np.int64],
    R: se2.Array,
    places: se2.Array,
    thing: NDArray[np.int64],
    steps: se2.Array,
    Q: se2.Array,
) -> Window:
    """Sightings (K, ...) brought into the base at the last one, with the noise of the way there.

    Args:
        polar: (K, 3) range, bearing, heading as sensed.
        dims: (K,) 3 where the heading counts.
        R: (K, 3, 3) covariance of `polar`.
        places: (K, 3) the things in the map.
        thing: (K,) which ones.
        steps: (K, 3) motion to each sighting from the one before.
        Q: (K, 3, 3) its covariance, in axes of the base before it.
    """
    K = len(polar)
    T, C = np.zeros((K, 3)), np.zeros((K, 3, 3))  # base at each sighting in the last base
    for k in range(K - 2, -1, -1):
        back = se2.inverse(steps[k + 1])
        T[k] = se2.compose(T[k + 1], back)
        A = _carried(T[k], T[k + 1])
        C[k] = C[k + 1] + A @ Q[k + 1] @ A.T
    reach, bearing = polar[:, 0], polar[:, 1]
    cos, sin = np.cos(bearing), np.sin(bearing)
    seen = np.column_stack([reach * cos, reach * sin])
    J = np.zeros((K, 3, 3))
    J[:, 0, 0], J[:, 0, 1] = cos, -reach * sin
    J[:, 1, 0], J[:, 1, 1] = sin, reach * cos
    J[:, 2, 2] = 1.0
    points = se2.transform_points(T, seen[:, None, :])[:, 0]
    lever = np.zeros((K, 3, 3))
    lever[:] = np.eye(3)
    lever[:, 0, 2], lever[:, 1, 2] = -points[:, 1], points[:, 0]
    cov = turned(J @ R @ np.swapaxes(J, 1, 2), T[:, 2])
    cov = cov + lever @ C @ np.swapaxes(lever, 1, 2)
    headings = np.where(dims == 3, se2.wrap_angle(polar[:, 2] + T[:, 2]), np.nan)
    return Window(points, headings, cov, places, thing)


def _carried(T_last_base: se2.Array, T_last_next: se2.Array) -> se2.Array:
    """(3, 3) how an error of the motion from one base to the next moves what the first one saw.

    Turned about the place of the next base; as x y yaw about the last base, but for the sign.
    """
    cos, sin = np.cos(T_last_base[2]), np.sin(T_last_base[2])
    return np.array([[cos, -sin, T_last_next[1]], [sin, cos, -T_last_next[0]], [0.0, 0.0, 1.0]])


def locate(window: Window) -> tuple[se2.Array, se2.Array] | None:
    """Base in map (3,) at the last sighting and its covariance (3, 3); None where it is not clear.

    The covariance is the inverse of the information of the sightings that agree.
    """
    if len(window.points) < LEAST_AGREEING:
        return None
    hypotheses = _hypotheses(window)
    if not len(hypotheses):
        return None
    costs = np.array([_cost(window, pose, 4.0) for pose in hypotheses])
    found: list[tuple[float, se2.Array, se2.Array, NDArray[np.bool_]]] = []
    for k in np.argsort(costs, kind="stable"):
        if any(_same(hypotheses[k], pose, cov) for _, pose, cov, _ in found):
            continue
        refined = _refined(window, hypotheses[k])
        if refined is None or any(_same(refined[0], pose, cov) for _, pose, cov, _ in found):
            continue
        found.append((_cost(window, refined[0]), *refined))
        if len(found) == _REFINED:
            break
    if not found:
        return None
    found.sort(key=lambda f: f[0])
    cost, pose, cov, agree = found[0]
    several = len(set(window.thing[agree].tolist())) > 1 or bool(
        np.isfinite(window.headings[agree]).any()
    )
    enough = agree.sum() >= LEAST_AGREEING and agree.mean() >= LEAST_SHARE and several
    clear = len(found) == 1 or found[1][0] - cost >= _MARGIN
    sigma_m, sigma_rad = np.sqrt(np.linalg.eigvalsh(cov[:2, :2])[-1]), np.sqrt(cov[2, 2])
    certain = sigma_m <= _VAGUE_M and sigma_rad <= _VAGUE_RAD
    return (pose, cov) if enough and clear and certain else None


def _hypotheses(window: Window) -> se2.Array:
    """(H, 3) poses: one for each pair of different things and each thing with a heading."""
    i, j = np.triu_indices(len(window.points), 1)
    different = window.thing[i] != window.thing[j]
    i, j = i[different], j[different]
    seen, there = window.points[j] - window.points[i], window.places[j] - window.places[i]
    yaw = np.arctan2(there[:, 1], there[:, 0]) - np.arctan2(seen[:, 1], seen[:, 0])
    middle = 0.5 * (window.points[i] + window.points[j])
    place = 0.5 * (window.places[i, :2] + window.places[j, :2])
    alone = np.flatnonzero(np.isfinite(window.headings))
    yaw = np.append(yaw, window.places[alone, 2] - window.headings[alone])
    middle = np.concatenate([middle, window.points[alone]])
    place = np.concatenate([place, window.places[alone, :2]])
    turn = np.column_stack([np.zeros((len(yaw), 2)), se2.wrap_angle(yaw)])
    off = se2.transform_points(turn, middle[:, None, :])[:, 0]
    return np.column_stack([place - off, turn[:, 2]])


def _residuals(window: Window, pose: se2.Array) -> tuple[se2.Array, se2.Array]:
    """What is expected less what was seen (K, 3), and its derivative by the pose (K, 3, 3)."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    away = window.places[:, :2] - pose[:2]
    turn = np.array([[cos, sin], [-sin, cos]])
    e = np.zeros((len(away), 3))
    e[:, :2] = away @ turn.T - window.points
    e[:, 2] = se2.wrap_angle(window.places[:, 2] - pose[2] - window.headings)
    J = np.zeros((len(away), 3, 3))
    J[:, :2, :2] = -turn
    J[:, :2, 2] = away @ np.array([[-sin, cos], [-cos, -sin]]).T
    J[:, 2, 2] = -1.0
    unknown = ~np.isfinite(e[:, 2])
    e[unknown, 2], J[unknown, 2] = 0.0, 0.0
    return e, J


def _whitened(window: Window, pose: se2.Array) -> tuple[se2.Array, se2.Array]:
    e, J = _residuals(window, pose)
    cov = window.cov.copy()
    unknown = ~np.isfinite(window.headings)
    cov[unknown, 2, :], cov[unknown, :, 2] = 0.0, 0.0
    cov[unknown, 2, 2] = 1.0
    L = np.linalg.cholesky(cov)
    return np.linalg.solve(L, e[:, :, None])[:, :, 0], np.linalg.solve(L, J)


def _cost(window: Window, pose: se2.Array, slack: float = 1.0) -> float:
    """Squared sigmas in all, those that disagree capped; `slack` forgives a rough hypothesis."""
    e, _ = _whitened(window, pose)
    return float(np.minimum(np.sum(e**2, axis=1) / slack, window.gates).sum())


def _refined(
    window: Window, pose: se2.Array
) -> tuple[se2.Array, se2.Array, NDArray[np.bool_]] | None:
    """Pose, covariance and who agrees, by Gauss-Newton; None where too few do."""
    slack = 4.0
    for _ in range(_ROUNDS):
        e, J = _whitened(window, pose)
        agree = np.sum(e**2, axis=1) <= slack * window.gates
        if agree.sum() < 2:
            return None
        slack = max(1.0, 0.5 * slack)
        information = np.einsum("kij,kil->jl", J[agree], J[agree])
        if np.linalg.cond(information) > 1e12:
            return None
        step = np.linalg.solve(information, np.einsum("kij,ki->j", J[agree], e[agree]))
        pose = pose - step
        pose[2] = float(se2.wrap_angle(pose[2]))
        if slack == 1.0 and np.abs(step).max() < _STILL:
            break
    cov = np.linalg.solve(information, np.eye(3))
    return pose, 0.5 * (cov + cov.T), agree


def _same(pose: se2.Array, other: se2.Array, cov: se2.Array) -> bool:
    """Whether a pose is the other one within its covariance and some centimetres."""
    off = pose - other
    off[2] = float(se2.wrap_angle(off[2]))
    near = np.diag([0.1**2, 0.1**2, 0.05**2])
    return bool(off @ np.linalg.solve(cov + near, off) < _GATE_WITH_HEADING)
