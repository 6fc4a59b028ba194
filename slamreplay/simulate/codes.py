"""Codes in the floor, and the camera of a mobile drive unit that reads them from above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2, se3
from slamreplay.simulate.drive import Motion

#: The camera on the robot: off the middle line and turned a little, as mounts are.
XYYAW_BASE_CAMERA = np.array([0.06, -0.01, 0.03])
CAMERA_HEIGHT_M = 0.12
#: A camera that looks down, its picture's upper edge to the front: x right, y back, z down.
_DOWN = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@dataclass(frozen=True)
class CodeFloor:
    """A square lattice of codes, numbered along its rows.

    Attributes:
        corner: x, y of code 0 in the map, m.
        columns: codes to a row,
        rows: and rows.
        spacing_m: from one to the next.
        size_m: edge of a code.
        worn: share of the codes that cannot be read.
        misread: share of the readings that give another code's number.
        hidden: stretches (from, to) in s in which the camera reads nothing: dirt on its window.
        rate_hz: pictures.
        reach_m: how far beside its axis the camera sees a whole code.
        sigma_m: noise of a reading's place, m,
        sigma_rad: and of its heading.
        laid_m: how far from its place a code was glued, m,
        laid_rad: and turned.
    """

    corner: tuple[float, float]
    columns: int
    rows: int
    spacing_m: float = 1.0
    size_m: float = 0.05
    worn: float = 0.05
    misread: float = 0.01
    hidden: tuple[tuple[float, float], ...] = ()
    rate_hz: float = 10.0
    reach_m: float = 0.12
    sigma_m: float = 0.002
    sigma_rad: float = 0.004
    laid_m: float = 0.002
    laid_rad: float = 0.004

    @property
    def places(self) -> se2.Array:
        """(C, 3) x y yaw where the codes should lie, by number."""
        row, column = np.divmod(np.arange(self.columns * self.rows), self.columns)
        x, y = self.corner[0] + self.spacing_m * column, self.corner[1] + self.spacing_m * row
        return np.column_stack([x, y, np.zeros(len(x))])


@dataclass(frozen=True, eq=False)
class Readings:
    """N readings, at most one in a picture.

    Attributes:
        t_s: (N,) when.
        number: (N,) as it was read.
        true_number: (N,) what lies there.
        T_camera_code: (N, 4, 4) pose of the code in the camera.
    """

    t_s: se2.Array
    number: NDArray[np.int64]
    true_number: NDArray[np.int64]
    T_camera_code: se2.Array


def camera_mount() -> se2.Array:
    """T_base_camera (4, 4)."""
    x, y, yaw = XYYAW_BASE_CAMERA
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0, 0, 1]])
    return se3.from_parts(turn @ _DOWN, np.array([x, y, CAMERA_HEIGHT_M]))


def read_codes(floor: CodeFloor, motion: Motion, rng: np.random.Generator) -> Readings:
    """What the camera reads on a drive."""
    places = floor.places
    laid = rng.standard_normal(places.shape) * [floor.laid_m, floor.laid_m, floor.laid_rad]
    worn = rng.random(len(places)) < floor.worn
    t_s = np.arange(0.05, motion.t_s[-1], 1.0 / floor.rate_hz)
    camera = se2.compose(motion.poses_at(t_s), XYYAW_BASE_CAMERA)
    off = camera[:, None, :2] - places[None, :, :2]
    far = np.hypot(off[..., 0], off[..., 1])
    nearest = np.argmin(far, axis=1)
    seen = (far[np.arange(len(t_s)), nearest] < floor.reach_m) & ~worn[nearest]
    for low, high in floor.hidden:
        seen &= (t_s < low) | (t_s >= high)
    t_s, camera, true = t_s[seen], camera[seen], nearest[seen]
    n = len(t_s)
    noise = rng.standard_normal((n, 3)) * [floor.sigma_m, floor.sigma_m, floor.sigma_rad]
    in_camera = se2.between(camera, (places + laid)[true]) + noise
    wrong = rng.random(n) < floor.misread
    number = np.where(wrong, (true + rng.integers(1, len(places), n)) % len(places), true)
    level = np.zeros((n, 4, 4))
    level[:] = np.eye(4)
    cos, sin = np.cos(in_camera[:, 2]), np.sin(in_camera[:, 2])
    level[:, 0, 0], level[:, 0, 1], level[:, 1, 0], level[:, 1, 1] = cos, -sin, sin, cos
    level[:, :2, 3] = in_camera[:, :2]
    looking = se3.from_parts(_DOWN, np.array([0.0, 0.0, CAMERA_HEIGHT_M]))
    return Readings(t_s, number, true, se3.inverse(looking) @ level)
