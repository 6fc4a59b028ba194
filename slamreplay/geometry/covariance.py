"""Covariance conventions, and what makes a matrix no covariance.

ROS (geometry_msgs/PoseWithCovariance) orders x y z rx ry rz about fixed axes of the parent frame.
gtsam's Pose3 tangent is rx ry rz x y z about the body's own axes. Feeding one as the other gave a
mean NEES of 10 060 instead of 6, which is why no other module reorders or rotates a covariance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slamreplay.geometry.se2 import Array, compose

#: Variance of an angle that may be any, uniform over the circle, rad^2.
ANY_ANGLE = np.pi**2 / 3.0

_PLANAR = np.array([0, 1, 5])
_ROTATION_FIRST = np.array([3, 4, 5, 0, 1, 2])


def planar_from_ros(covariance: ArrayLike) -> Array:
    """The (..., 3, 3) block of x y yaw, parent axes, of ROS ones (..., 36) or (..., 6, 6)."""
    full = np.asarray(covariance, dtype=np.float64)
    full = full.reshape((*full.shape[:-1], 6, 6)) if full.shape[-1] == 36 else full
    return full[..., _PLANAR[:, None], _PLANAR]


def ros_from_planar(covariance: ArrayLike) -> Array:
    """ROS covariances (..., 36) of x y yaw blocks (..., 3, 3); the other entries are zero."""
    block = np.asarray(covariance, dtype=np.float64)
    full = np.zeros((*block.shape[:-2], 6, 6))
    full[..., _PLANAR[:, None], _PLANAR] = block
    return full.reshape((*block.shape[:-2], 36))


def ros_turned(covariance: ArrayLike, R_to_from: ArrayLike) -> Array:
    """ROS covariances (..., 6, 6) seen from axes that R_to_from (3, 3) leads to.

    Both parts are turned; the frame's origin does not matter, for errors are differences. An entry
    is NaN only where one that is NaN takes part in it: who turns about z keeps x and y of a pose
    whose height was never told.

    Args:
        covariance: (..., 36) or (..., 6, 6) about the old axes.
        R_to_from: (3, 3).
    """
    full = np.asarray(covariance, dtype=np.float64)
    full = full.reshape((*full.shape[:-1], 6, 6)) if full.shape[-1] == 36 else full
    turn = _block_diagonal(np.asarray(R_to_from, dtype=np.float64))
    part = (np.abs(turn) > 1e-9).astype(np.float64)
    missing = np.isnan(full)
    out = turn @ np.where(missing, 0.0, full) @ turn.T
    out[part @ missing @ part.T > 0.0] = np.nan
    return out


def ros_of_other_point(covariance: ArrayLike, lever: ArrayLike) -> Array:
    """ROS covariances (..., 6, 6) of the pose of another frame that is fixed to the same body.

    Its origin lies at `lever` (..., 3) from the first one's, along the parent's axes: a rotation
    error moves it by d_theta x lever, and turns it as it turns the first one.
    """
    x, y, z = np.moveaxis(np.asarray(lever, dtype=np.float64), -1, 0)
    J = np.zeros((*x.shape, 6, 6))
    J[..., range(6), range(6)] = 1.0
    J[..., 0, 4], J[..., 0, 5] = z, -y
    J[..., 1, 3], J[..., 1, 5] = -z, x
    J[..., 2, 3], J[..., 2, 4] = y, -x
    return J @ np.asarray(covariance, dtype=np.float64) @ np.swapaxes(J, -1, -2)


def gtsam_from_ros(covariance: ArrayLike, R_parent_body: ArrayLike) -> Array:
    """Gtsam Pose3 covariances (..., 6, 6) from ROS ones (..., 6, 6) and the pose's rotation.

    Both parts of the error are only turned from the parent's axes to the body's; it is not the full
    adjoint, for in ROS the position part is the error of the origin itself.
    """
    cov = np.asarray(covariance, dtype=np.float64)[..., _ROTATION_FIRST[:, None], _ROTATION_FIRST]
    turn = _block_diagonal(np.swapaxes(np.asarray(R_parent_body, dtype=np.float64), -1, -2))
    return turn @ cov @ np.swapaxes(turn, -1, -2)


def ros_from_gtsam(covariance: ArrayLike, R_parent_body: ArrayLike) -> Array:
    """ROS covariances (..., 6, 6) from gtsam Pose3 ones: the inverse of `gtsam_from_ros`."""
    turn = _block_diagonal(np.asarray(R_parent_body, dtype=np.float64))
    cov = turn @ np.asarray(covariance, dtype=np.float64) @ np.swapaxes(turn, -1, -2)
    back = np.argsort(_ROTATION_FIRST)
    return cov[..., back[:, None], back]


def ros_from_openvins(rotation: ArrayLike, position: ArrayLike, R_parent_body: ArrayLike) -> Array:
    """ROS covariances (..., 6, 6) from the two blocks of a trajectory file of OpenVINS.

    Its rotation error is local, about the body's own axes, and its position error is the parent's:
    ov_eval holds -Log(R_body_parent R_body_parent_hat') against the rotation block, and turns that
    block by R_parent_body to see it from the parent (ResultTrajectory::calculate_nees and
    calculate_error). What position and rotation have in common is not in the file: zero.

    Args:
        rotation: (..., 3, 3) rad^2 about the body's axes.
        position: (..., 3, 3) m^2 along the parent's axes.
        R_parent_body: (..., 3, 3) rotation of the pose.
    """
    R = np.asarray(R_parent_body, dtype=np.float64)
    position = np.asarray(position, dtype=np.float64)
    out = np.zeros((*position.shape[:-2], 6, 6))
    out[..., :3, :3] = position
    out[..., 3:, 3:] = R @ np.asarray(rotation, dtype=np.float64) @ np.swapaxes(R, -1, -2)
    return out


def openvins_from_ros(covariance: ArrayLike, R_parent_body: ArrayLike) -> tuple[Array, Array]:
    """Rotation and position blocks (..., 3, 3) as OpenVINS files have them, of ROS (..., 6, 6).

    The inverse of `ros_from_openvins`; what position and rotation have in common is lost.
    """
    cov = np.asarray(covariance, dtype=np.float64)
    R = np.asarray(R_parent_body, dtype=np.float64)
    return np.swapaxes(R, -1, -2) @ cov[..., 3:, 3:] @ R, cov[..., :3, :3]


def planar_from_gtsam(covariance: ArrayLike, yaw: ArrayLike) -> Array:
    """Parent-axes x y yaw covariances (..., 3, 3) from gtsam Pose2 (body axes) and headings."""
    return turned(covariance, yaw)


def gtsam_from_planar(covariance: ArrayLike, yaw: ArrayLike) -> Array:
    """Gtsam Pose2 covariances (..., 3, 3), body axes, from parent-axes ones and headings in rad."""
    return turned(covariance, -np.asarray(yaw, dtype=np.float64))


def turned(covariance: ArrayLike, yaw: ArrayLike) -> Array:
    """Planar covariances (..., 3, 3) seen from a frame turned by `yaw` (...) rad: R P R'."""
    turn = _yaw_rotation(np.asarray(yaw, dtype=np.float64))
    return turn @ np.asarray(covariance, dtype=np.float64) @ np.swapaxes(turn, -1, -2)


def is_symmetric(covariance: ArrayLike) -> NDArray[np.bool_]:
    """Which of the matrices (..., n, n) are finite and symmetric, but for rounding, as a mask."""
    cov = np.asarray(covariance, dtype=np.float64)
    finite = np.asarray(np.isfinite(cov).all(axis=(-2, -1)))
    inside = np.where(finite[..., None, None], cov, 0.0)  # an infinity minus itself would warn
    scale = np.abs(inside).max(axis=(-2, -1), initial=0.0)
    skew = np.abs(inside - np.swapaxes(inside, -2, -1)).max(axis=(-2, -1), initial=0.0)
    return np.asarray(finite & (skew <= 1e-9 * scale))


def composed(
    xyyaw_a_b: ArrayLike, cov_a_b: ArrayLike, xyyaw_b_c: ArrayLike, cov_b_c: ArrayLike
) -> Array:
    """Covariances (..., 3, 3) of T_a_c = T_a_b @ T_b_c, about axes of a, of independent poses.

    To first order: the heading error of b swings c about b's origin (the compounding of Smith, Self
    and Cheeseman, Estimating uncertain spatial relationships in robotics, 1990).

    Args:
        xyyaw_a_b: (..., 3).
        cov_a_b: (..., 3, 3) about axes of a.
        xyyaw_b_c: (..., 3).
        cov_b_c: (..., 3, 3) about axes of b.
    """
    yaw = np.asarray(xyyaw_a_b, dtype=np.float64)[..., 2]
    by = swing(compose(xyyaw_a_b, xyyaw_b_c), xyyaw_a_b)
    cov = np.asarray(cov_a_b, dtype=np.float64)
    return by @ cov @ np.swapaxes(by, -1, -2) + turned(cov_b_c, yaw)


def between(
    xyyaw_a_b: ArrayLike, cov_a_b: ArrayLike, xyyaw_a_c: ArrayLike, cov_a_c: ArrayLike
) -> Array:
    """Covariances (..., 3, 3) of T_b_c = inverse(T_a_b) @ T_a_c about axes of b, to first order.

    Both poses (..., 3) with their covariances (..., 3, 3) about axes of a. They are taken to be
    independent; of poses whose errors are alike it is more than there is.
    """
    yaw = np.asarray(xyyaw_a_b, dtype=np.float64)[..., 2]
    by = swing(xyyaw_a_c, xyyaw_a_b)
    start = by @ np.asarray(cov_a_b, dtype=np.float64) @ np.swapaxes(by, -1, -2)
    return turned(start + np.asarray(cov_a_c, dtype=np.float64), -yaw)


def swing(xyyaw_a_c: ArrayLike, xyyaw_a_b: ArrayLike) -> Array:
    """Derivatives (..., 3, 3) of T_a_c by T_a_b, which carries c, both (..., 3) in axes of a."""
    step = np.asarray(xyyaw_a_c, dtype=np.float64) - np.asarray(xyyaw_a_b, dtype=np.float64)
    out = np.zeros((*step.shape[:-1], 3, 3))
    out[..., 0, 0] = out[..., 1, 1] = out[..., 2, 2] = 1.0
    out[..., 0, 2], out[..., 1, 2] = -step[..., 1], step[..., 0]
    return out


def is_positive_definite(covariance: ArrayLike) -> NDArray[np.bool_]:
    """Which of the matrices (..., n, n) are finite, symmetric and positive definite, as a mask."""
    cov = np.asarray(covariance, dtype=np.float64)
    flat = cov.reshape((-1, *cov.shape[-2:]))
    sound = is_symmetric(flat)
    sound[sound] = np.linalg.eigvalsh(flat[sound])[:, 0] > 0.0
    return sound.reshape(cov.shape[:-2])


def _block_diagonal(R: Array) -> Array:
    out = np.zeros((*R.shape[:-2], 6, 6))
    out[..., :3, :3] = R
    out[..., 3:, 3:] = R
    return out


def _yaw_rotation(yaw: Array) -> Array:
    cos, sin = np.cos(yaw), np.sin(yaw)
    out = np.zeros((*yaw.shape, 3, 3))
    out[..., 0, 0], out[..., 0, 1] = cos, -sin
    out[..., 1, 0], out[..., 1, 1] = sin, cos
    out[..., 2, 2] = 1.0
    return out
