"""Satellite fixes in metres: east and north of the first one, or in the map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2, se3
from slamreplay.geometry.geodesy import enu_axes_at

#: What a receiver that says nothing of its noise is taken to have, and the least of any: m.
_USUAL_M, _LEAST_M = 3.0, 0.02
#: How far an antenna that tf does not place may sit from the base's origin, m.
_ANYWHERE_M = 0.3


@dataclass(frozen=True, eq=False)
class SatelliteFixes:
    """N positions of the antenna.

    Attributes:
        t_ns: (N,) when.
        xy: (N, 2) m; east and north of the first fix, or x and y of the map.
        cov: (N, 2, 2) about those axes, m^2.
        antenna_xy: (2,) the antenna in the base, m.
        topic: of the receiver.
    """

    t_ns: NDArray[np.int64]
    xy: se2.Array
    cov: se2.Array
    antenna_xy: se2.Array
    topic: str

    def __len__(self) -> int:
        return len(self.t_ns)


def satellite_fixes(view: BundleView) -> SatelliteFixes | None:
    """The fixes of the receiver with most of them, east and north of the first one, or None."""
    table = view.table("references")
    table = _most(table.take((table["kind"] == "gnss") & (table["frame_id"] == "earth")))
    if not len(table):
        return None
    first = table["position_xyz"][0]
    axes = enu_axes_at(first)
    return _fixes(view, table, axes, -(axes @ first))


def fixes_in_map(view: BundleView) -> SatelliteFixes | None:
    """The fixes of the receiver with most of them, x and y of the map.

    None where there are none, or where static transforms do not tie their frame to the map: what
    runs through the localizer's own correction would hold it against itself.
    """
    table, target = view.table("references"), view.manifest.frames.map or "map"
    is_point = np.isnan(table["orientation_xyzw"]).all(axis=1)
    table = _most(table.take((table["kind"] == "gnss") & is_point))
    if not len(table):
        return None
    T = view.transforms.fixed(target, str(table["frame_id"][0]))
    return None if T is None else _fixes(view, table, T[:3, :3], T[:3, 3])


def _most(table: Table) -> Table:
    """The rows of the topic that has most of them, sorted by time."""
    topics, counts = np.unique(table["topic"].astype(str), return_counts=True)
    if not len(topics):
        return table
    return table.take(table["topic"] == topics[np.argmax(counts)]).sorted_by_time()


def _fixes(view: BundleView, table: Table, R: se2.Array, origin: se2.Array) -> SatelliteFixes:
    """Rows of one receiver in a frame of which R (3, 3) holds the axes, as rows."""
    cov = R[:2] @ table["covariance"].reshape(-1, 6, 6)[:, :3, :3] @ R[:2].T
    told = np.isfinite(cov).all(axis=(1, 2))
    told[told] = np.linalg.eigvalsh(cov[told])[:, 0] > 0.0
    cov[~told] = np.eye(2) * _USUAL_M**2
    cov += np.eye(2) * _LEAST_M**2
    antenna = _antenna(view, str(table["child_frame_id"][0]))
    if antenna is None:
        cov += np.eye(2) * _ANYWHERE_M**2
    first = table["position_xyz"][0]  # subtracted first: in `earth` it is millions of metres
    xy = ((table["position_xyz"] - first) @ R.T + (R @ first + origin))[:, :2]
    place = np.zeros(2) if antenna is None else antenna
    return SatelliteFixes(table.t_ns, xy, cov, place, str(table["topic"][0]))


def _antenna(view: BundleView, frame: str) -> se2.Array | None:
    base = view.manifest.frames.base or "base_link"
    if frame == base:
        return np.zeros(2)
    T = view.transforms.fixed(base, frame) if frame else None
    return None if T is None else np.asarray(se3.planar(T[None])[0, :2])
