"""What decoders do with values that cannot be: mend and count, or leave the row out and count."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slamreplay.bundle.manifest import LEADING_SLASH
from slamreplay.bundle.tables import Ragged
from slamreplay.geometry import se3
from slamreplay.geometry.times import Times
from slamreplay.ingest.decoders.decoder import Decoded, Remark


def pose_rows(
    position_xyz: ArrayLike, orientation_xyzw: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.bool_], tuple[Remark, ...]]:
    """Unit quaternions (N, 4), the mask (N,) of usable poses, and remarks on the others."""
    position = np.asarray(position_xyz, dtype=np.float64)
    unit, sound = se3.unit_quaternion(orientation_xyzw)
    turned: NDArray[np.bool_] = np.asarray(np.isfinite(unit).all(axis=1))
    placed: NDArray[np.bool_] = np.asarray(np.isfinite(position).all(axis=1))
    remarks = (
        Remark("repaired", int((turned & placed & ~sound).sum()), "quaternion normalised"),
        Remark("lost", int((~turned).sum()), "quaternion is zero or not finite"),
        Remark("lost", int((turned & ~placed).sum()), "position is not finite"),
    )
    return unit, turned & placed, remarks


def slashed(*names: NDArray[Any]) -> Remark:
    """The remark on rows of which a frame name, of texts (N,) each, begins with a slash.

    tf2 knows no such names; the tf of ROS 1 added them.
    """
    odd = np.zeros(len(names[0]), dtype=bool)
    for column in names:
        slashes = [name for name in set(column.tolist()) if name.startswith("/")]
        if slashes:
            odd |= np.isin(column, slashes)
    return Remark("repaired", int(odd.sum()), LEADING_SLASH)


def kept(
    keep: NDArray[np.bool_],
    columns: Mapping[str, Any],
    rows: NDArray[np.int64],
    t_sensor_ns: Times,
    remarks: tuple[Remark, ...],
) -> Decoded:
    """The rows (N,) under the mask `keep`, of every column."""
    if keep.all():
        return Decoded(dict(columns), rows, t_sensor_ns, remarks)
    index = np.flatnonzero(keep)
    taken = {k: v.take(index) if isinstance(v, Ragged) else v[index] for k, v in columns.items()}
    return Decoded(taken, rows[index], t_sensor_ns[index], remarks)
