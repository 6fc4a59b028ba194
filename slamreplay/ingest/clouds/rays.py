"""Where a spinning lidar looked when nothing came back: the ray that each place of a cloud is for.

In an organised cloud of a spinning lidar each ring has its elevation and each column its azimuth,
so what came back elsewhere tells the direction of a ray that did not. A camera's pixels are not
laid out so, nor is a heap of points: there a missing point says nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.ingest.clouds.fields import Clouds

#: A ring's points keep its elevation and its columns' azimuths to these, rad, nine times in ten.
_ELEVATION, _AZIMUTH = np.radians(0.3), np.radians(0.6)
#: A ring is known from this share of its columns, and turns so far: no camera sees as much.
_SHARE, _WIDE = 0.2, np.radians(150.0)
_FEWEST_COLUMNS = 64


def ray_table(clouds: Clouds) -> NDArray[np.float32] | None:
    """(3, R) unit vectors in the sensor's frame of the R places in a cloud; NaN where not known.

    None where clouds are not organised, differ in size, or are no spinning lidar's.
    """
    size = np.diff(clouds.offsets)
    if not len(clouds) or np.ptp(size) or np.ptp(clouds.rows) or clouds.rows[0] < 2:
        return None
    rows = int(clouds.rows[0])
    columns = int(size[0]) // rows
    if not columns:
        return None
    # (3, clouds, rows, columns); some drivers lay out rings as columns.
    xyz = clouds.xyz.reshape(3, len(clouds), rows, columns).astype(np.float64)
    table = _by_ring(xyz)
    if not np.isfinite(table).any():
        table = np.swapaxes(_by_ring(np.swapaxes(xyz, 2, 3)), 1, 2)
    flat = table.reshape(3, -1).astype(np.float32)
    return flat if np.isfinite(flat).any() else None


def _by_ring(xyz: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, rings, columns) of clouds (3, N, rings, columns)."""
    _, _, rings, columns = xyz.shape
    table = np.full((3, rings, columns), np.nan)
    if columns < _FEWEST_COLUMNS:
        return table
    column = np.arange(columns)
    for ring in range(rings):
        x, y, z = xyz[:, :, ring]
        seen = np.isfinite(x)
        if seen.mean() < _SHARE:
            continue
        elevation = np.arctan2(z, np.hypot(x, y))
        azimuth = np.arctan2(y, x)
        level = float(np.median(elevation[seen]))
        step = np.diff(azimuth, axis=1)
        step = _wrapped(step[np.isfinite(step)])
        if not len(step):
            continue
        # One step for all columns: a whole turn, or as the steps between neighbours have it.
        pace = float(np.median(step))
        turn = np.copysign(2.0 * np.pi / columns, pace)
        pace = turn if abs(pace - turn) < 0.1 * abs(turn) else pace
        ahead = _wrapped(azimuth - pace * column)[seen]
        start = float(np.angle(np.mean(np.exp(1j * ahead))))
        off = np.abs(_wrapped(ahead - start)), np.abs(elevation[seen] - level)
        if np.quantile(off[0], 0.9) > _AZIMUTH or np.quantile(off[1], 0.9) > _ELEVATION:
            continue
        if abs(pace) * columns < _WIDE:
            continue
        bearing = start + pace * column
        table[:, ring] = [np.cos(level) * np.cos(bearing), np.cos(level) * np.sin(bearing),
                          np.full(columns, np.sin(level))]  # fmt: skip
    return table


def _wrapped(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)
