"""Which way is up in an inertial unit."""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import BundleView
from slamreplay.geometry.se2 import Array

#: Up is the mean specific force of so many first samples, where it is this near to gravity, m/s^2.
_SAMPLES, _GRAVITY, _NEAR = 20, 9.81, 1.0


def upright_axis(view: BundleView, table: Table) -> Array | None:
    """(3,) the robot's upright axis in the frame of a unit, None where nothing tells it.

    By tf, else by what the unit feels at first: what it feels from there on must not depend on what
    comes later.

    Args:
        view: the log.
        table: rows of one topic of table `imu`, one at least.
    """
    base, frame = view.manifest.frames.base, str(table["frame_id"][0])
    if base and (frame == base or view.transforms.has_path(base, frame)):
        T = view.transforms.fixed(base, frame)
        if T is not None:
            return np.asarray(T[2, :3])
    force = view.recorded("imu")
    force = force.take(force["topic"] == table["topic"][0]).sorted_by_time()
    felt = force["linear_acceleration_xyz"][:_SAMPLES]
    mean = felt[np.isfinite(felt).all(axis=1)].mean(axis=0) if len(felt) else np.zeros(3)
    size = float(np.linalg.norm(mean))
    return mean / size if abs(size - _GRAVITY) < _NEAR else None
