"""Rows of the synthetic bundle's tables, from times in seconds after its start."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.geometry import se2, se3
from slamreplay.geometry.times import NS_PER_S, ns

START_NS = 1_700_000_000 * NS_PER_S
#: How much later than its stamp a message is recorded.
LATENCY_NS = 5_000_000


def tf_rows(
    parent: str,
    child: str,
    t_s: NDArray[np.float64],
    xyyaw: se2.Array,
    *,
    is_static: bool = False,
    ahead_s: float = 0.0,
) -> Table:
    """One edge of tf: poses (N, 3) of the child at times (N,), stamped so much ahead."""
    pose = pose_columns(xyyaw)
    table = table_of(
        "transforms",
        "/tf_static" if is_static else "/tf",
        t_s,
        parent_frame=parent,
        child_frame=child,
        is_static=is_static,
        translation_xyz=pose["position_xyz"],
        rotation_xyzw=pose["orientation_xyzw"],
    )
    return table.replace(t_ns=table.t_ns + ns(ahead_s), t_sensor_ns=table.t_ns + ns(ahead_s))


def pose_columns(xyyaw: se2.Array) -> dict[str, se2.Array]:
    """Columns of a table of poses, of x y yaw (N, 3)."""
    position = np.column_stack([xyyaw[:, :2], np.zeros(len(xyyaw))])
    return {"position_xyz": position, "orientation_xyzw": se3.quaternion_from_yaw(xyyaw[:, 2])}


def table_of(name: str, topic: str, t_s: NDArray[np.float64], /, **columns: Any) -> Table:
    """A table whose scalars are repeated for every row."""
    t_ns = ns_of(t_s)
    whole: dict[str, Any] = {
        "t_ns": t_ns,
        "t_sensor_ns": t_ns,
        "t_log_ns": t_ns + LATENCY_NS,
        "topic": topic,
    }
    whole |= columns
    rows = {k: [v] * len(t_ns) if np.ndim(v) == 0 else v for k, v in whole.items()}
    return Table(TABLES[name], rows)


def ns_of(t_s: NDArray[np.float64]) -> NDArray[np.int64]:
    """(N,) nanoseconds of seconds (N,) after the start."""
    return np.rint(np.asarray(t_s) * NS_PER_S).astype(np.int64) + START_NS
