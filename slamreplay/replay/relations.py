"""A trajectory against relations: motions between pairs of scans that somebody measured.

The metric of Kuemmerle et al. (On measuring the accuracy of SLAM algorithms, Autonomous Robots 27,
2009, 387-407, eq. 3): mean over the pairs of how far the estimated motion is from the measured one.
It needs no trajectory of reference and no common frame. Translation and rotation apart and without
squares, as Hess et al. (ICRA 2016) print it.
"""

from __future__ import annotations

import numpy as np

from slamreplay.bundle.schema import RELATIONS
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.geometry import se2, se3

NAMES = ("relations_m", "relations_std_m", "relations_rad", "relations_std_rad", "relations_n")


def relation_metrics(track: PoseTrack | None, bundle: Bundle) -> dict[str, float | None]:
    """Mean and standard deviation of both errors, m and rad, and the number of pairs; None without.

    Args:
        track: one row per scan, or at other times: then it is interpolated at the scans.
        bundle: with table `relations`.
    """
    nothing: dict[str, float | None] = dict.fromkeys(NAMES)
    topic = bundle.manifest.topic_of("scan")
    relations = bundle.table(RELATIONS)
    if track is None or topic is None or not len(relations):
        return nothing
    scans = bundle.table("scans")
    scans = scans.take(scans["topic"] == topic).sorted_by_time()
    is_by_scan = np.array_equal(track.t_ns, scans.t_ns)
    xyyaw = track.xyyaw if is_by_scan else track.at(scans.t_ns).xyyaw
    row_of = {int(stamp): row for row, stamp in enumerate(scans["t_sensor_ns"].tolist())}
    pairs = zip(relations["t_sensor_ns"].tolist(), relations["t2_sensor_ns"].tolist(), strict=True)
    rows = np.array([(row_of.get(a, -1), row_of.get(b, -1)) for a, b in pairs], dtype=np.int64)
    measured = np.column_stack(
        [relations["position_xyz"][:, :2], se3.yaw_from_quaternion(relations["orientation_xyzw"])]
    )
    off = relation_errors(xyyaw, rows, measured)
    off = off[(rows >= 0).all(axis=1) & np.isfinite(off).all(axis=1)]
    if not len(off):
        return nothing
    distance, turn = np.hypot(off[:, 0], off[:, 1]), np.abs(off[:, 2])
    values = (distance.mean(), distance.std(), turn.mean(), turn.std(), len(off))
    return {name: float(value) for name, value in zip(NAMES, values, strict=True)}


def relation_errors(xyyaw: se2.Array, rows: np.ndarray, measured: se2.Array) -> se2.Array:
    """(M, 3) x y yaw between measured (M, 3) and estimated motions of pairs of rows (M, 2)."""
    motion = se2.between(xyyaw[rows[:, 0]], xyyaw[rows[:, 1]])
    off = se2.between(measured, motion)
    off[:, 2] = se2.wrap_angle(off[:, 2])
    return np.asarray(off)
