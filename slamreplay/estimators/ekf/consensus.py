"""Where the robot is, from some sightings in a row and nothing before them.

Two things seen at known ranges and bearings fix a pose; a wrong barcode among them fixes a wrong
one. So every pair makes a hypothesis, the one that most sightings agree with is refined by
Gauss-Newton on these, and it only counts where no other place explains the sightings as well:
RANSAC (Fischler and Bolles 1981) over all pairs instead of random ones, for a window holds few.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

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

    @cached_property
    def gates(self) -> se2.Array:
        """(K,) largest squared sigmas of a sighting that agrees."""
        return np.where(np.isfinite(self.headings), _GATE_WITH_HEADING, _GATE)

    @cached_property
    def whitener(self) -> se2.Array:
        """(K, 3, 3) inverse Cholesky factors of the covariances, zero for unknown headings."""
        cov, unknown = self.cov.copy(), ~np.isfinite(self.headings)
        cov[unknown, 2, :], cov[unknown, :, 2] = 0.0, 0.0
        cov[unknown, 2, 2] = 1.0
        out = np.linalg.solve(np.linalg.cholesky(cov), np.eye(3))
        out[unknown, 2] = 0.0
        return np.asarray(out)


def window_of(
    seen: se2.Array,
    dims: NDArray[np.int64],
    R: se2.Array,
    places: se2.Array,
    thing: NDArray[np.int64],
    steps: se2.Array,
    Q: se2.Array,
) -> Window:
    """Sightings (K, ...) brought into the base at the last one, with the noise of the way there.

    Args:
        seen: (K, 3) x, y, heading in the base as sensed.
        dims: (K,) 3 where the heading counts.
        R: (K, 3, 3) covariance of `seen`.
        places: (K, 3) the things in the map.
        thing: (K,) which ones.
        steps: (K, 3) motion to each sighting from the one before.
        Q: (K, 3, 3) its covariance, in axes of the base before it.
    """
    K = len(seen)
    T, C = np.zeros((K, 3)), np.zeros((K, 3, 3))  # base at each sighting in the last base
    for k in range(K - 2, -1, -1):
        back = se2.inverse(steps[k + 1])
        T[k] = se2.compose(T[k + 1], back)
        A = _carried(T[k], T[k + 1])
        C[k] = C[k + 1] + A @ Q[k + 1] @ A.T
    points = se2.transform_points(T, seen[:, None, :2])[:, 0]
    lever = np.zeros((K, 3, 3))
    lever[:] = np.eye(3)
    lever[:, 0, 2], lever[:, 1, 2] = -points[:, 1], points[:, 0]
    cov = turned(R, T[:, 2]) + lever @ C @ np.swapaxes(lever, 1, 2)
    headings = np.where(dims == 3, se2.wrap_angle(seen[:, 2] + T[:, 2]), np.nan)
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
    costs = _costs(window, hypotheses, 4.0)
    found: list[tuple[float, se2.Array, se2.Array, NDArray[np.bool_]]] = []
    for k in np.argsort(costs, kind="stable"):
        if any(_same(hypotheses[k], pose, cov) for _, pose, cov, _ in found):
            continue
        refined = _refined(window, hypotheses[k])
        if refined is None or any(_same(refined[0], pose, cov) for _, pose, cov, _ in found):
            continue
        found.append((float(_costs(window, refined[0][None])[0]), *refined))
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


def _residuals(window: Window, poses: se2.Array) -> se2.Array:
    """(H, K, 3) whitened: what is expected from poses (H, 3) less what was seen."""
    cos, sin = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    x, y = (window.places[None, :, i] - poses[:, i, None] for i in (0, 1))
    yaw = window.places[None, :, 2] - poses[:, 2, None] - window.headings
    e = np.stack(
        [
            cos * x + sin * y - window.points[:, 0],
            cos * y - sin * x - window.points[:, 1],
            np.where(np.isfinite(yaw), se2.wrap_angle(yaw), 0.0),
        ],
        axis=-1,
    )
    return np.asarray(np.einsum("kij,hkj->hki", window.whitener, e))


def _derivative(window: Window, pose: se2.Array) -> se2.Array:
    """(K, 3, 3) of the whitened residuals by the pose (3,)."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    x, y = window.places[:, 0] - pose[0], window.places[:, 1] - pose[1]
    J = np.zeros((len(x), 3, 3))
    J[:, :2, :2] = [[-cos, -sin], [sin, -cos]]
    J[:, 0, 2], J[:, 1, 2], J[:, 2, 2] = cos * y - sin * x, -cos * x - sin * y, -1.0
    return window.whitener @ J


def _costs(window: Window, poses: se2.Array, slack: float = 1.0) -> se2.Array:
    """(H,) squared sigmas in all, those that disagree capped; `slack` forgives rough poses."""
    squares = np.sum(_residuals(window, poses) ** 2, axis=-1)
    return np.asarray(np.minimum(squares / slack, window.gates).sum(axis=1))


def _refined(
    window: Window, pose: se2.Array
) -> tuple[se2.Array, se2.Array, NDArray[np.bool_]] | None:
    """Pose, covariance and who agrees, by Gauss-Newton; None where too few do."""
    slack = 4.0
    for _ in range(_ROUNDS):
        e, J = _residuals(window, pose[None])[0], _derivative(window, pose)
        agree = np.sum(e**2, axis=1) <= slack * window.gates
        information = np.einsum("kij,kil->jl", J[agree], J[agree])
        eigenvalues = np.linalg.eigvalsh(information)
        if eigenvalues[0] <= 1e-12 * eigenvalues[-1]:
            return None
        slack = max(1.0, 0.5 * slack)
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
