"""Motion within a sweep where odometry missed it: a robot that is carried, pushed or slips.

A beam is laid out by the motion since the sweep began. Wheels that stand while the robot is carried
at 3 m/s leave a sweep of 0.1 s as it is, and its scan then fits where the robot was in the middle
of the sweep, 0.15 m further on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.scans import ScanSet
from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2
from slamreplay.geometry.times import ns
from slamreplay.hindsight.beams import Beams
from slamreplay.hindsight.chain import Chain
from slamreplay.hindsight.way import between_keyframes

#: Odometry that misses less than this during one sweep is left alone: it is smoother than the
#: motion between two matched scans.
SMEAR_M, SMEAR_RAD = 0.03, 0.01


@dataclass(frozen=True, eq=False)
class Matched:
    """Motion where odometry missed some of it.

    Attributes:
        motion: odometry, but as the scans have it over the links that it missed.
        spans_ns: (S, 2) when sweeps began that it would have smeared, both ends included.
    """

    motion: PoseTrack
    spans_ns: NDArray[np.int64]

    def mended(self, told: Beams, matched: Beams) -> Beams:
        """Scans as odometry lays them out, but as matched where it would smear them."""
        ends = told.ends.copy()
        for first_ns, last_ns in self.spans_ns:
            rows = (told.t_ns >= first_ns) & (told.t_ns <= last_ns)
            ends[rows] = matched.ends[rows]
        return Beams(told.t_ns, ends, told.kind, told.laser_xy)


def motion_as_matched(
    base: str,
    t_ns: NDArray[np.int64],
    odometry: se2.Array,
    keys: NDArray[np.int64],
    chain: Chain,
    sweep_s: float,
) -> Matched | None:
    """Odometry, but as the scans have it over links on which it would smear a sweep.

    Args:
        base: name of the base frame.
        t_ns: (N,) times of the scans.
        odometry: (N, 3) odometry at the scans.
        keys: (K,) indices of the keyframes among the scans.
        chain: how the keyframes' scans lie to each other.
        sweep_s: how long one sweep takes, s.

    Returns:
        None where odometry misses nothing that matters.
    """
    if len(keys) < 2 or not sweep_s > 0.0:
        return None
    told = se2.between(odometry[keys[:-1]], odometry[keys[1:]])
    seen = se2.between(chain.xyyaw[:-1], chain.xyyaw[1:])
    off = se2.between(told, seen)
    sweeps = np.maximum(np.diff(t_ns[keys]) / 1e9 / sweep_s, 1.0)
    smeared = np.hypot(off[:, 0], off[:, 1]) > SMEAR_M * sweeps
    smeared |= np.abs(off[:, 2]) > SMEAR_RAD * sweeps
    smeared &= ~chain.is_break[1:]
    if not smeared.any():
        return None
    anchors = np.empty((len(keys), 3))
    anchors[0] = odometry[keys[0]]
    for k, step in enumerate(np.where(smeared[:, None], seen, told)):
        anchors[k + 1] = se2.compose(anchors[k], step)
    poses = between_keyframes(t_ns, odometry, keys, anchors).xyyaw
    links = np.flatnonzero(smeared)
    spans = np.column_stack([t_ns[keys[links]] - ns(sweep_s), t_ns[keys[links + 1]]])
    return Matched(PoseTrack.without_covariance("odom", base, t_ns, poses), spans)


def longest_sweep_s(lasers: Sequence[ScanSet]) -> float:
    """How long the slowest sweep of any laser takes, s; 0 where none tells."""
    each = [np.nan_to_num(s.time_increment_s) * (s.ranges_m.shape[1] - 1) for s in lasers]
    return max(float(sweep.max(initial=0.0)) for sweep in each)
