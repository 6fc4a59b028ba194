"""Tags, docks and satellite fixes of a log, each brought to the keyframe nearest to it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.fixes import SatelliteFixes, satellite_fixes
from slamreplay.bundle.sightings import Sightings, sightings_of
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import turned
from slamreplay.geometry.times import ns
from slamreplay.hindsight.sensed import Sensed

#: A sighting belongs to a keyframe up to this far away by odometry: metres, radians, seconds.
_REACH_M, _REACH_RAD, _REACH_S = 0.5, 0.5, 5.0
#: What odometry may miss on the way there, per metre and per radian, and at least: m, rad.
_SLIP, _LEAST_M, _LEAST_RAD = 0.1, 0.01, 0.005


def sensed(
    view: BundleView,
    motion: PoseTrack,
    key_ns: NDArray[np.int64],
    matched: se2.Array,
    to_working: se2.Array,
) -> Sensed | None:
    """What the view holds of tags, docks and fixes, at keyframes; None where it holds nothing.

    Args:
        view: the evidence.
        motion: the base in the odom frame.
        key_ns: (K,) times of the keyframes, ascending.
        matched: (K, 3) their scan-matched poses in a frame that drifts slowly.
        to_working: (3,) the map frame in the frame of the keyframes' poses.
    """
    if not len(key_ns) or not len(view.table("references")):
        return None
    nearest, step = _nearest(motion, key_ns, motion.t_ns)
    way = se2.compose(matched[nearest], step)
    smooth = PoseTrack.without_covariance("odom", motion.child_frame_id, motion.t_ns, way)
    seen, fixes = sightings_of(view, smooth), satellite_fixes(view)
    if seen is None and fixes is None:
        return None
    key, where = _nearest(motion, key_ns, np.empty(0, dtype=np.int64))
    names: tuple[str, ...] = ()
    name, cov = np.empty(0, dtype=np.int64), np.empty((0, 3, 3))
    if seen is not None:
        names = tuple(sorted(set(seen.name)))
        key, where, name, cov = _sightings(seen, names, motion, key_ns)
    surveyed = np.full((len(names), 3), np.nan)
    if seen is not None:
        for j, one in enumerate(names):
            if one in seen.surveyed:
                surveyed[j] = se2.compose(to_working, seen.surveyed[one])
    fix_key, antenna, xy, fix_cov = _fixes(fixes, motion, key_ns)
    return Sensed(key, name, where, cov, names, surveyed, fix_key, antenna, xy, fix_cov)


def _sightings(
    seen: Sightings, names: tuple[str, ...], motion: PoseTrack, key_ns: NDArray[np.int64]
) -> tuple[NDArray[np.int64], se2.Array, NDArray[np.int64], se2.Array]:
    """Of each keyframe and thing the sighting that was nearest by odometry."""
    key, step = _nearest(motion, key_ns, seen.t_ns)
    name = np.searchsorted(np.array(names, dtype=object), seen.name)
    way = np.hypot(step[:, 0], step[:, 1]) + np.abs(step[:, 2])
    order = np.lexsort((np.abs(seen.t_ns - key_ns[key]), way, name, key))
    order = order[np.isfinite(way[order]) & _in_reach(step[order])]
    order = order[np.abs(seen.t_ns - key_ns[key])[order] <= ns(_REACH_S)]
    pair = key[order] * len(names) + name[order]
    order = order[np.append(True, pair[1:] != pair[:-1])[: len(pair)]]
    cov = turned(seen.cov[order], step[order, 2])
    metres = _LEAST_M + _SLIP * np.hypot(step[order, 0], step[order, 1])
    radians = _LEAST_RAD + _SLIP * np.abs(step[order, 2])
    far = np.hypot(seen.xyyaw[order, 0], seen.xyyaw[order, 1])
    cov[:, range(2), range(2)] += (metres**2 + (radians * far) ** 2)[:, None]
    cov[:, 2, 2] += radians**2
    return key[order], se2.compose(step[order], seen.xyyaw[order]), name[order], cov


def _fixes(
    fixes: SatelliteFixes | None, motion: PoseTrack, key_ns: NDArray[np.int64]
) -> tuple[NDArray[np.int64], se2.Array, se2.Array, se2.Array]:
    """Of each keyframe the nearest fix."""
    if fixes is None:
        none = np.empty(0, dtype=np.int64)
        return none, np.empty((0, 3)), np.empty((0, 2)), np.empty((0, 2, 2))
    key, step = _nearest(motion, key_ns, fixes.t_ns)
    order = np.lexsort((np.abs(fixes.t_ns - key_ns[key]), key))
    order = order[_in_reach(step[order])]
    order = order[np.append(True, key[order][1:] != key[order][:-1])[: len(order)]]
    antenna = se2.compose(step[order], np.array([*fixes.antenna_xy, 0.0]))
    return key[order], antenna, fixes.xy[order], fixes.cov[order]


def _nearest(
    motion: PoseTrack, key_ns: NDArray[np.int64], t_ns: NDArray[np.int64]
) -> tuple[NDArray[np.int64], se2.Array]:
    """The keyframe (N,) nearest in time and the base at that time seen from it (N, 3)."""
    after = np.clip(np.searchsorted(key_ns, t_ns), 1, max(len(key_ns) - 1, 1))
    after = np.minimum(after, len(key_ns) - 1)
    before = np.maximum(after - 1, 0)
    key = np.where(t_ns - key_ns[before] <= key_ns[after] - t_ns, before, after)
    return key, se2.between(motion.at(key_ns).xyyaw[key], motion.at(t_ns).xyyaw)


def _in_reach(step: se2.Array) -> NDArray[np.bool_]:
    with np.errstate(invalid="ignore"):
        near = np.hypot(step[:, 0], step[:, 1]) <= _REACH_M
        return np.asarray(near & (np.abs(step[:, 2]) <= _REACH_RAD))
