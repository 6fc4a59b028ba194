"""Satellite fixes: east and north of the first one, in metres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
        xy: (N, 2) east and north of the first fix, m.
        cov: (N, 2, 2) about those axes, m^2.
        antenna_xy: (2,) the antenna in the base, m.
    """

    t_ns: NDArray[np.int64]
    xy: se2.Array
    cov: se2.Array
    antenna_xy: se2.Array

    def __len__(self) -> int:
        return len(self.t_ns)


def satellite_fixes(view: BundleView) -> SatelliteFixes | None:
    """The fixes of the receiver with most of them, or None."""
    table = view.table("references")
    table = table.take((table["kind"] == "gnss") & (table["frame_id"] == "earth"))
    if not len(table):
        return None
    topics, counts = np.unique(table["topic"].astype(str), return_counts=True)
    table = table.take(table["topic"] == topics[np.argmax(counts)]).sorted_by_time()
    earth = table["position_xyz"]
    axes = enu_axes_at(earth[0])[:2]
    cov = axes @ table["covariance"].reshape(-1, 6, 6)[:, :3, :3] @ axes.T
    told = np.isfinite(cov).all(axis=(1, 2))
    told[told] = np.linalg.eigvalsh(cov[told])[:, 0] > 0.0
    cov[~told] = np.eye(2) * _USUAL_M**2
    cov += np.eye(2) * _LEAST_M**2
    antenna = _antenna(view, str(table["child_frame_id"][0]))
    if antenna is None:
        cov += np.eye(2) * _ANYWHERE_M**2
    xy = (earth - earth[0]) @ axes.T
    return SatelliteFixes(table.t_ns, xy, cov, np.zeros(2) if antenna is None else antenna)


def _antenna(view: BundleView, frame: str) -> se2.Array | None:
    base = view.manifest.frames.base or "base_link"
    if frame == base:
        return np.zeros(2)
    if not frame or not view.transforms.has_path(base, frame):
        return None
    if not all(edge.is_static for edge in view.transforms.path(base, frame)):
        return None
    T, _ = view.transforms.lookup(base, frame, np.zeros(1, dtype=np.int64))
    return np.asarray(se3.planar(T)[0, :2])
