"""What the robot sensed beside the scans, tied to keyframes: tags, docks and satellite fixes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.fixes import SatelliteFixes, satellite_fixes
from slamreplay.bundle.sightings import Sightings, sightings_of
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.alignment import aligned
from slamreplay.geometry.covariance import turned
from slamreplay.geometry.times import ns
from slamreplay.graph import sightings as graph

#: A sighting belongs to a keyframe up to this far away by odometry: metres, radians, seconds.
_REACH_M, _REACH_RAD, _REACH_S = 0.5, 0.5, 5.0
#: What odometry may miss on the way there, per metre and per radian, and at least: m, rad.
_SLIP, _LEAST_M, _LEAST_RAD = 0.1, 0.01, 0.005
#: Sightings of one thing by neighbouring keyframes share the camera's and the tag's own errors, and
#: fixes of one receiver those of the sky: each is given that much more variance.
SAME_THING, SAME_SKY = 3.0, 10.0
#: Sightings under one name farther apart than this are of two things.
ONE_THING_M = 2.0
#: Fixes tell of a frame if the way is this many times longer than they err.
_WORTH = 2.0


@dataclass(frozen=True, eq=False)
class Sensed:
    """M sightings and F fixes, each seen from a keyframe.

    Attributes:
        key: (M,) the keyframe.
        name: (M,) index into `names`.
        xyyaw: (M, 3) the thing seen from the keyframe.
        cov: (M, 3, 3) in axes of the keyframe.
        names: the things' names, their kind first.
        surveyed: (L, 3) poses in the working frame of the things that are surveyed, else NaN.
        fix_key: (F,) the keyframe of a fix.
        fix_xyyaw: (F, 3) the antenna seen from the keyframe; its heading is the base's then.
        fix_xy: (F, 2) the antenna in the fixes' frame.
        fix_cov: (F, 2, 2) in axes of the fixes' frame.
    """

    key: NDArray[np.int64]
    name: NDArray[np.int64]
    xyyaw: se2.Array
    cov: se2.Array
    names: tuple[str, ...]
    surveyed: se2.Array
    fix_key: NDArray[np.int64]
    fix_xyyaw: se2.Array
    fix_xy: se2.Array
    fix_cov: se2.Array

    def joined(self) -> Mapping[str, int]:
        """How many measurements of each kind join the pose graph."""
        kinds = [self.names[j].split(" ")[0] for j in self.name]
        counts = {kind: kinds.count(kind) for kind in sorted(set(kinds))}
        return {**counts, "gnss": len(self.fix_key)} if len(self.fix_key) else counts

    def constraints(self, poses: se2.Array) -> tuple[graph.Sightings | None, graph.Fixes | None]:
        """What joins the pose graph where the keyframes are at about these poses (K, 3)."""
        return self._landmarks(poses), self._fixes(poses)

    def _landmarks(self, poses: se2.Array) -> graph.Sightings | None:
        placed = se2.compose(poses[self.key], self.xyyaw)
        landmark = np.full(len(self.key), -1, dtype=np.int64)
        initial: list[se2.Array] = []
        known: list[bool] = []
        for j in range(len(self.names)):
            rows = np.flatnonzero(self.name == j)
            is_known = bool(np.isfinite(self.surveyed[j]).all())
            parts = [rows] if is_known else _apart(placed[rows], rows)
            for part in parts:
                # Seen from one place only, a thing that nobody surveyed says nothing.
                if len(np.unique(self.key[part])) < 2 and not is_known:
                    continue
                landmark[part] = len(initial)
                middle = part[np.argmin(_distances(placed[part]).sum(axis=1))]
                initial.append(self.surveyed[j] if is_known else placed[middle])
                known.append(is_known)
        use = np.flatnonzero(landmark >= 0)
        if not len(use):
            return None
        return graph.Sightings(
            self.key[use],
            landmark[use],
            self.xyyaw[use],
            SAME_THING * self.cov[use],
            np.array(initial),
            np.array(known),
        )

    def _fixes(self, poses: se2.Array) -> graph.Fixes | None:
        if len(self.fix_key) < 3:
            return None
        antenna = se2.compose(poses[self.fix_key], self.fix_xyyaw)
        spread = np.sqrt(np.linalg.eigvalsh(np.cov(self.fix_xy.T))[-1])
        if spread < _WORTH * np.sqrt(np.median(self.fix_cov[:, 0, 0] + self.fix_cov[:, 1, 1])):
            return None
        frame = aligned(self.fix_xy, antenna[:, :2])
        seen = np.column_stack([self.fix_xy, se2.wrap_angle(antenna[:, 2] - frame[2])])
        at_key = se2.compose(seen, se2.inverse(self.fix_xyyaw))
        return graph.Fixes(self.fix_key, at_key, SAME_SKY * self.fix_cov, frame)


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


def _apart(placed: se2.Array, rows: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Rows in groups that are connected by steps under `ONE_THING_M`, each thing a group."""
    from scipy.sparse.csgraph import connected_components

    count, label = connected_components(_distances(placed) < ONE_THING_M, directed=False)
    return [rows[label == i] for i in range(count)]


def _distances(placed: se2.Array) -> se2.Array:
    return np.asarray(np.hypot(*(placed[:, None, :2] - placed[None, :, :2]).transpose(2, 0, 1)))
