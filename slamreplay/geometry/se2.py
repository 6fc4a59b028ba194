"""Planar rigid motion on arrays of poses (..., 3): x m, y m, yaw rad."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def wrap_angle(angle: ArrayLike) -> Array:
    """Angle(s) in radians brought into [-pi, pi)."""
    return (np.asarray(angle, dtype=np.float64) + np.pi) % (2.0 * np.pi) - np.pi


def compose(xyyaw_a_b: ArrayLike, xyyaw_b_c: ArrayLike) -> Array:
    """T_a_c = T_a_b @ T_b_c for poses (..., 3); leading axes broadcast."""
    a, b = np.asarray(xyyaw_a_b, dtype=np.float64), np.asarray(xyyaw_b_c, dtype=np.float64)
    cos, sin = np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack(
        [
            a[..., 0] + cos * b[..., 0] - sin * b[..., 1],
            a[..., 1] + sin * b[..., 0] + cos * b[..., 1],
            wrap_angle(a[..., 2] + b[..., 2]),
        ],
        axis=-1,
    )


def inverse(xyyaw_a_b: ArrayLike) -> Array:
    """T_b_a from T_a_b, for poses (..., 3)."""
    a = np.asarray(xyyaw_a_b, dtype=np.float64)
    cos, sin = np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack(
        [
            -cos * a[..., 0] - sin * a[..., 1],
            sin * a[..., 0] - cos * a[..., 1],
            wrap_angle(-a[..., 2]),
        ],
        axis=-1,
    )


def between(xyyaw_a_b: ArrayLike, xyyaw_a_c: ArrayLike) -> Array:
    """T_b_c: the motion from pose b to pose c, both given in a."""
    return compose(inverse(xyyaw_a_b), xyyaw_a_c)


def transform_points(xyyaw_a_b: ArrayLike, points_b: ArrayLike) -> Array:
    """Points (..., N, 2) in b brought into a by one pose (..., 3) for each leading index."""
    pose = np.asarray(xyyaw_a_b, dtype=np.float64)[..., None, :]
    points = np.asarray(points_b, dtype=np.float64)
    cos, sin = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    x, y = points[..., 0], points[..., 1]
    return np.stack([pose[..., 0] + cos * x - sin * y, pose[..., 1] + sin * x + cos * y], axis=-1)


def interpolate(t_ns: NDArray[np.int64], xyyaw: Array, at_ns: NDArray[np.int64]) -> Array:
    """Poses (M, 3) at times `at_ns`, linear in x and y and on the shorter arc in yaw.

    Args:
        t_ns: (N,) sorted times of the samples, N >= 1.
        xyyaw: (N, 3) the samples.
        at_ns: (M,) asked-for times; outside the samples the nearest sample is held, so a caller
            that must not extrapolate masks those times first.
    """
    low = np.clip(np.searchsorted(t_ns, at_ns, side="right") - 1, 0, max(len(t_ns) - 2, 0))
    high = np.minimum(low + 1, len(t_ns) - 1)
    span = np.maximum(t_ns[high] - t_ns[low], 1)
    part = np.clip((at_ns - t_ns[low]) / span, 0.0, 1.0)[:, None]
    step = xyyaw[high] - xyyaw[low]
    step[:, 2] = wrap_angle(step[:, 2])
    out = xyyaw[low] + part * step
    out[:, 2] = wrap_angle(out[:, 2])
    return np.asarray(out, dtype=np.float64)
