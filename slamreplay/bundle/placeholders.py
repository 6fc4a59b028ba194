"""Numbers that stand where nothing was measured: zeros, constants, 1e6, 1e308.

One rule: the tables keep what was recorded, and whoever reads through a view (estimators,
hindsight, checks, verdict) finds NaN, "not given", instead of a placeholder. A column is judged
over its whole topic, for one row cannot show that it never changes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.covariance_faults import (
    FEWEST,
    MOVED_M,
    MOVED_RAD,
    PLANAR,
    SPATIAL,
    Judged,
    judge_covariances,
    moved_by,
)
from slamreplay.bundle.tables import Table

FROZEN = "one and the same value throughout"

#: Which columns of which tables are judged. Start poses are commands and references say what they
#: say: neither is an estimate of the robot's.
COLUMNS = {
    "poses": ("covariance",),
    "odometry": (
        "pose_covariance",
        "twist_covariance",
        "linear_velocity_xyz",
        "angular_velocity_xyz",
    ),
    "imu": (
        "orientation_covariance",
        "angular_velocity_covariance",
        "linear_acceleration_covariance",
        "angular_velocity_xyz",
        "linear_acceleration_xyz",
    ),
}


def without_placeholders(table: Table, map_frame: str | None) -> Table:
    """A table whose placeholders are NaN; the very same table where it has none.

    Args:
        table: as it was recorded.
        map_frame: the frame in which a pose's uncertainty need not grow.
    """
    changed: dict[str, NDArray[np.float64]] = {}
    for topic in dict.fromkeys(table["topic"]) if table.schema.name in COLUMNS else ():
        rows = np.flatnonzero(table["topic"] == topic)
        part = table.take(rows)
        for name in COLUMNS[table.schema.name]:
            judged = judge(part, name, map_frame)
            if any(fault.any() for fault in judged.faults.values()):
                changed.setdefault(name, table[name].copy())[rows] = judged.values
    return table.replace(**changed) if changed else table


def judge(rows: Table, name: str, map_frame: str | None) -> Judged:
    """One of `COLUMNS` in the rows of one topic."""
    values = rows[name]
    if rows.schema.name == "imu" and name.endswith("_xyz"):
        return _one_value(values, len(values) >= FEWEST**2)
    if name.endswith("_xyz"):
        moved = moved_by(rows, map_frame)
        went = moved.spread_m > MOVED_M if name.startswith("linear") else moved.turned > MOVED_RAD
        return _one_value(values, went and not values.any())
    if name.endswith("twist_covariance"):
        return judge_covariances(values.reshape(-1, 6, 6), PLANAR, None)
    if values.shape[1] == 36:
        return judge_covariances(values.reshape(-1, 6, 6), PLANAR, moved_by(rows, map_frame))
    return judge_covariances(values.reshape(-1, 3, 3), SPATIAL, None)


def _one_value(values: NDArray[np.float64], suspect: bool) -> Judged:
    """Velocities, rates or accelerations (N, 3): a sensor that works is never quite the same."""
    same = suspect and len(values) > 0 and bool((values == values[:1]).all())
    fault = np.full(len(values), same)
    return Judged(np.where(fault[:, None], np.nan, values), {FROZEN: fault})
