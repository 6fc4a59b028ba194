"""What the unit that plays the role of the IMU tells, to be changed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Table
from slamreplay.bundle.upright import upright_axis
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.geometry.se2 import Array


@dataclass(frozen=True, eq=False)
class Inertial:
    """The rows of one unit.

    Attributes:
        table: table `imu`, of all units.
        rows: of this one, sorted by time.
        up: (3,) the robot's upright axis in the unit's frame; its own z axis where nothing tells.
    """

    table: Table
    rows: NDArray[np.int64]
    up: Array


def inertial(view: BundleView, name: str) -> Inertial:
    """The unit that plays the role of the IMU.

    Raises:
        NotApplicableError: the log has none.
    """
    table = view.table("imu")
    rows = np.flatnonzero(table["topic"] == view.manifest.topic_of("imu"))
    if not len(rows):
        raise NotApplicableError("the log has no IMU", where=name)
    rows = rows[np.argsort(table.t_ns[rows], kind="stable")]
    up = upright_axis(view, table.take(rows))
    # Accelerations that never change are placeholders to a view, and still say which way is up:
    # an exchanged table must not take that away.
    force = view.recorded("imu")["linear_acceleration_xyz"]
    up = np.array([0.0, 0.0, 1.0]) if up is None else up
    return Inertial(table.replace(linear_acceleration_xyz=force), rows, up)
