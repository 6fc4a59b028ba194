"""Rigid transforms in space: quaternions at the border, (N, 4, 4) matrices inside."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slamreplay.geometry.se2 import Array, wrap_angle

#: Drivers that round to float32 stay within this; beyond it a quaternion was never normalised.
UNIT_TOLERANCE = 1e-2


def unit_quaternion(
    quaternion_xyzw: ArrayLike, tolerance: float = UNIT_TOLERANCE
) -> tuple[Array, NDArray[np.bool_]]:
    """Normalised quaternions (..., 4) and a mask (...) of those that needed no repair.

    A zero or non-finite quaternion carries no rotation: it becomes NaN, so that nothing downstream
    mistakes it for "no rotation".
    """
    q = np.asarray(quaternion_xyzw, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        norm = np.linalg.norm(q, axis=-1)
        unit = q / norm[..., None]
        sound = np.abs(norm - 1.0) <= tolerance
    unit[~((norm > 1e-9) & (norm < np.inf))] = np.nan
    return unit, sound


def rotation_matrix(quaternion_xyzw: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4); they are normalised first."""
    q, _ = unit_quaternion(quaternion_xyzw)
    x, y, z, w = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def matrix(translation_xyz: ArrayLike, quaternion_xyzw: ArrayLike) -> Array:
    """T (..., 4, 4) from translation (..., 3) in metres and quaternion (..., 4)."""
    return from_parts(rotation_matrix(quaternion_xyzw), translation_xyz)


def from_parts(R: ArrayLike, translation_xyz: ArrayLike) -> Array:
    """T (..., 4, 4) from rotation matrices (..., 3, 3) and translations (..., 3) in metres."""
    translation = np.asarray(translation_xyz, dtype=np.float64)
    T = np.zeros((*translation.shape[:-1], 4, 4))
    T[..., :3, :3] = R
    T[..., :3, 3] = translation
    T[..., 3, 3] = 1.0
    return T


def inverse(T_a_b: ArrayLike) -> Array:
    """T_b_a (..., 4, 4) from T_a_b."""
    T = np.asarray(T_a_b, dtype=np.float64)
    out = np.zeros_like(T)
    R_t = np.swapaxes(T[..., :3, :3], -1, -2)
    out[..., :3, :3] = R_t
    out[..., :3, 3] = -(R_t @ T[..., :3, 3:])[..., 0]
    out[..., 3, 3] = 1.0
    return out


def rotation_vector(R: ArrayLike) -> Array:
    """Axis times angle in rad, angle 0 to pi, of rotation matrices (..., 3, 3): their logarithm.

    By way of the quaternion; by the skew part alone half turns would have no axis. NaN stays NaN.
    """
    q = _scaled_quaternion(R)
    length = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(length, q[..., 3:])
    # Without a turn there is no axis, and the vector is as good as twice the quaternion's.
    return np.asarray(q[..., :3] * angle / np.where(length > 0.0, length, 1.0))


def quaternion(R: ArrayLike) -> Array:
    """Unit quaternions (..., 4) xyzw of rotation matrices (..., 3, 3), w not negative."""
    q = _scaled_quaternion(R)
    return np.asarray(q / np.linalg.norm(q, axis=-1, keepdims=True))


def _scaled_quaternion(R: ArrayLike) -> Array:
    """Quaternions (..., 4) xyzw of any length, w not negative.

    With the largest of the four components in the denominator, which is good at every angle.
    """
    R = np.asarray(R, dtype=np.float64)
    trace = R[..., 0, 0] + R[..., 1, 1] + R[..., 2, 2]
    # Row k is the quaternion x y z w times four times its k-th component.
    scaled = np.empty((*R.shape[:-2], 4, 4))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        scaled[..., i, i] = 1.0 + R[..., i, i] - R[..., j, j] - R[..., k, k]
        scaled[..., i, j] = scaled[..., j, i] = R[..., i, j] + R[..., j, i]
        scaled[..., i, 3] = scaled[..., 3, i] = R[..., k, j] - R[..., j, k]
    scaled[..., 3, 3] = 1.0 + trace
    largest = np.argmax(np.diagonal(scaled, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(scaled, largest[..., None, None], axis=-2)[..., 0, :]
    return np.asarray(q * np.where(q[..., 3:] < 0.0, -1.0, 1.0))


def rotation_from_vector(vector: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of axis times angle (..., 3) in rad: the exponential."""
    v = np.asarray(vector, dtype=np.float64)
    half = 0.5 * np.linalg.norm(v, axis=-1, keepdims=True)
    # sinc is sin(pi x) / (pi x), and has its limit at zero.
    q = np.concatenate([0.5 * v * np.sinc(half / np.pi), np.cos(half)], axis=-1)
    return rotation_matrix(q)


def quaternion_from_yaw(yaw: ArrayLike) -> Array:
    """Quaternions (..., 4) xyzw of rotations by `yaw` rad about z."""
    half = np.asarray(yaw, dtype=np.float64) / 2.0
    zero = np.zeros_like(half)
    return np.stack([zero, zero, np.sin(half), np.cos(half)], axis=-1)


def quaternion_from_rpy(roll: ArrayLike, pitch: ArrayLike, yaw: ArrayLike) -> Array:
    """(..., 4) x y z w of turns about the parent's x, then y, then z axis (REP-103), rad."""
    halves = [np.asarray(angle, dtype=np.float64) / 2.0 for angle in (roll, pitch, yaw)]
    (cr, cp, cy), (sr, sp, sy) = [np.cos(h) for h in halves], [np.sin(h) for h in halves]
    return np.stack(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ],
        axis=-1,
    )


def yawed(quaternion_xyzw: ArrayLike, yaw: ArrayLike) -> Array:
    """Quaternions (N, 4) after turns by `yaw` (N,), or one for all, rad about the parent's z axis.

    That is q_yaw q.
    """
    x, y, z, w = np.asarray(quaternion_xyzw, dtype=np.float64).T
    half = np.asarray(yaw, dtype=np.float64) / 2.0
    c, s = np.cos(half), np.sin(half)
    return np.column_stack([c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z])


def yaw_from_quaternion(quaternion_xyzw: ArrayLike) -> Array:
    """Heading in radians (...): the z angle of the z-y-x Euler angles, as tf's getYaw gives it."""
    q, _ = unit_quaternion(quaternion_xyzw)
    x, y, z, w = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    return np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def planar(T_a_b: ArrayLike) -> Array:
    """The planar pose (..., 3) x y yaw of T (..., 4, 4): z, roll and pitch are left out."""
    T = np.asarray(T_a_b, dtype=np.float64)
    yaw = np.arctan2(T[..., 1, 0], T[..., 0, 0])
    return np.stack([T[..., 0, 3], T[..., 1, 3], wrap_angle(yaw)], axis=-1)


def from_planar(xyyaw: ArrayLike) -> Array:
    """T (..., 4, 4) in the plane z = 0 from poses (..., 3)."""
    pose = np.asarray(xyyaw, dtype=np.float64)
    cos, sin = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    T = np.zeros((*pose.shape[:-1], 4, 4))
    T[..., 0, 0], T[..., 0, 1], T[..., 0, 3] = cos, -sin, pose[..., 0]
    T[..., 1, 0], T[..., 1, 1], T[..., 1, 3] = sin, cos, pose[..., 1]
    T[..., 2, 2] = T[..., 3, 3] = 1.0
    return T
