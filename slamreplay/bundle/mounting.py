"""Where a camera sits that tf does not place: found from what it saw while the robot moved."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2
from slamreplay.geometry.times import ns

#: After so long a tag is another one, for odometry drifts.
_VISIT_S = 10.0
#: Sightings needed, and how far the robot must have turned in view of tags for a place to show.
_LEAST, _TURN = 30, 0.6
#: Along the robot's upright axis a tag's distance may vary by this part of how it varies across.
_FLAT = 0.25
#: A tag that seems to move by more than this is no tag that stands still, m.
_SPREAD_M = 0.15
#: Metres may come out by so much off (noise alone makes them small) before it is no camera's place.
_SCALE = 0.2


def planar_mount(
    t_ns: NDArray[np.int64], names: NDArray[np.object_], position: se2.Array, motion: PoseTrack
) -> se2.Array | None:
    """T_base_camera (4, 4), its height 0, or None where the sightings do not tell.

    The robot moves in a plane, so a tag keeps its distance along one axis of the camera: that axis
    is upright. The rest, x, y and heading, is what makes tags stand still while the robot moves:
    linear in the place, the cosine and sine of the heading and the tags' places.

    Args:
        t_ns: (N,) times of the sightings, ascending.
        names: (N,) which tag.
        position: (N, 3) the tag in the camera, m.
        motion: the base in a frame that drifts by centimetres at the most in ten seconds: what
            wheels miss in a turn would be taken for the camera's place.
    """
    base = motion.at(t_ns).xyyaw
    known = np.isfinite(base).all(axis=1)
    if known.sum() < _LEAST:
        return None
    position, base = position[known], base[known]
    group = _visits(t_ns[known], names[known])
    turns = [np.ptp(np.unwrap(base[group == g, 2])) for g in range(group.max() + 1)]
    if max(turns) < _TURN:
        return None
    within = position - _means(position, group)
    values, axes = np.linalg.eigh(within.T @ within / len(within))
    if values[0] > _FLAT**2 * values[1]:
        return None
    best: tuple[float, se2.Array] | None = None
    for up in (axes[:, 0], -axes[:, 0]):
        level = np.array([axes[:, 2], np.cross(up, axes[:, 2])])
        x, y, yaw, scale, spread = _fitted(position @ level.T, base, group)
        if abs(scale - 1.0) < _SCALE and (best is None or spread < best[0]):
            c, s = np.cos(yaw), np.sin(yaw)
            T = np.eye(4)
            T[:2, :3] = np.array([[c, -s], [s, c]]) @ level
            T[2, :3] = up
            T[:2, 3] = x, y
            best = (spread, T)
    return None if best is None or best[0] > _SPREAD_M else best[1]


def _visits(t_ns: NDArray[np.int64], names: NDArray[np.object_]) -> NDArray[np.int64]:
    """(N,) number of the short stretch of one tag's sightings that each belongs to."""
    group, count = np.zeros(len(t_ns), dtype=np.int64), 0
    for name in sorted(set(names)):
        rows = np.flatnonzero(names == name)
        start = t_ns[rows[0]]
        for row in rows.tolist():
            if t_ns[row] - start > ns(_VISIT_S):
                start, count = t_ns[row], count + 1
            group[row] = count
        count += 1
    return group


def _means(values: se2.Array, group: NDArray[np.int64]) -> se2.Array:
    counts = np.bincount(group)
    means = np.column_stack([np.bincount(group, weights=v) / counts for v in values.T])
    return np.asarray(means[group])


def _fitted(
    seen: se2.Array, base: se2.Array, group: NDArray[np.int64]
) -> tuple[float, float, float, float, float]:
    """Camera x, y and heading, metres per metre seen, and the tags' median spread in m.

    Least squares with Huber's weights on base + R (place + turn seen) = tag of the visit; the tags
    are taken out by subtracting each visit's mean. First with the cosine and sine of the heading
    free, which is linear and tells the scale; then with the heading alone (Gauss and Newton).
    """
    cos, sin = np.cos(base[:, 2]), np.sin(base[:, 2])
    u, v = seen.T
    rows = np.stack([
        np.column_stack([cos, -sin, cos * u - sin * v, -cos * v - sin * u, base[:, 0]]),
        np.column_stack([sin, cos, sin * u + cos * v, -sin * v + cos * u, base[:, 1]]),
    ])  # fmt: skip
    weight, free = np.ones(len(seen)), np.zeros(4)
    for _ in range(5):
        A = _centred(rows, weight, group)
        free = _solved(A[:, :4], -A[:, 4], weight)
        weight = _huber(_length(A @ np.append(free, 1.0)))
    x, y, yaw = float(free[0]), float(free[1]), float(np.arctan2(free[3], free[2]))
    for _ in range(10):
        A = _centred(rows, weight, group)
        whole = np.array([x, y, np.cos(yaw), np.sin(yaw), 1.0])
        J = np.column_stack([A[:, :2], A[:, 3] * np.cos(yaw) - A[:, 2] * np.sin(yaw)])
        step = _solved(J, -(A @ whole), weight)
        x, y, yaw = x + float(step[0]), y + float(step[1]), yaw + float(step[2])
        weight = _huber(_length(A @ whole))
    apart = _length(_centred(rows, weight, group) @ [x, y, np.cos(yaw), np.sin(yaw), 1.0])
    return x, y, yaw, float(np.hypot(free[2], free[3])), float(np.median(apart))


def _centred(rows: se2.Array, weight: se2.Array, group: NDArray[np.int64]) -> se2.Array:
    """(2 N, C) of rows (2, N, C) without the weighted mean of their visit."""
    total = np.bincount(group, weights=weight)
    out = []
    for part in rows:
        mean = [np.bincount(group, weights=weight * c) / total for c in part.T]
        out.append(part - np.column_stack(mean)[group])
    return np.concatenate(out)


def _solved(A: se2.Array, b: se2.Array, weight: se2.Array) -> se2.Array:
    root = np.sqrt(np.tile(weight, 2))
    return np.asarray(np.linalg.lstsq(A * root[:, None], b * root, rcond=None)[0])


def _length(both: se2.Array) -> se2.Array:
    return np.asarray(np.hypot(*both.reshape(2, -1)))


def _huber(apart: se2.Array) -> se2.Array:
    return np.minimum(1.0, 1.5 * np.median(apart) / np.maximum(apart, 1e-6))
