"""Transforms that are dated ahead on purpose, so that they can be used until the next one comes.

AMCL stamps map -> odom with the scan's stamp plus `transform_tolerance` (1.0 s by default),
gmapping and robot_state_publisher with their own clock plus a constant. Neither is a fault of a
clock: the stamps of all else that is on tf stay where they are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from slamreplay.audit.delays import delays
from slamreplay.audit.streams import Stream
from slamreplay.bundle.manifest import Clock
from slamreplay.geometry.times import NS_PER_S

#: A stamp belongs to a scan if the lead is that of the others to within this: rounding of floats.
_SAME_NS = 1_000_000
#: Share of the transforms that must have it, and the fewest of them.
_SHARE, _FEWEST = 0.8, 10
#: A localizer may be so many scans behind.
_BEHIND = 4
#: A lead is constant if it scatters by less, or by less than this part of it.
_STEADY_S, _STEADY = 0.02, 0.2
#: Nobody dates a transform farther ahead: that is another clock.
_MOST_S = 30.0


@dataclass(frozen=True)
class Lead:
    """A constant by which an edge is dated ahead.

    Attributes:
        over: the scan it was made from, or the log time at which it was recorded.
        seconds: how far.
        share: of its transforms that have just this lead.
        n: transforms.
    """

    over: Literal["scan", "log time"]
    seconds: float
    share: float
    n: int


def lead(edge: Stream, clock: Clock, scans: Stream | None) -> Lead | None:
    """How an edge is dated ahead, or None where it is not by any constant.

    Args:
        edge: a stream of tf.
        clock: the bundle's, for a log whose times are none of the stamps' own.
        scans: what the localizer hears, None without a laser; to be given for the edge that
            corrects odometry only, for no other is made of scans.
    """
    if len(edge) < _FEWEST or not edge.stamped.any():
        return None
    found = None if scans is None else _over_scans(edge, scans)
    if found is not None:
        return found
    for sent in (edge.t_log_ns, clock.from_log_time(edge.t_log_ns)):
        late = delays(sent, edge.t_sensor_ns)
        if late is not None and late.lead_s is not None and late.lead_s < _MOST_S:
            steady = late.jitter_s <= max(_STEADY_S, _STEADY * late.lead_s)
            return Lead("log time", late.lead_s, 1.0, late.n) if steady else None
    return None


def _over_scans(edge: Stream, scans: Stream) -> Lead | None:
    """The lead over the scan that had come last, or one of the few before it."""
    stamps, arrived = scans.t_sensor_ns[scans.stamped], scans.t_log_ns[scans.stamped]
    own, sent = edge.t_sensor_ns[edge.stamped], edge.t_log_ns[edge.stamped]
    last = np.searchsorted(arrived, sent, side="right") - 1
    own, last = own[last >= 0], last[last >= 0]
    if len(own) < _FEWEST:
        return None
    ordered = np.sort(stamps)
    best: Lead | None = None
    for behind in range(_BEHIND):
        ahead = own - stamps[np.maximum(last - behind, 0)]
        typical = int(np.median(ahead))
        # The scan a transform was made from may be another one: any with just this lead will do.
        made = own - typical
        above = np.minimum(np.searchsorted(ordered, made), len(ordered) - 1)
        below = np.maximum(above - 1, 0)
        off = np.minimum(np.abs(ordered[above] - made), np.abs(ordered[below] - made))
        share = float((off <= _SAME_NS).mean())
        if typical > _SAME_NS and share >= _SHARE and (best is None or share > best.share):
            best = Lead("scan", typical / NS_PER_S, share, len(own))
    return best
