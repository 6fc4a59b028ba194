"""Every threshold of the verdict, with its unit; all can be set."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slamreplay.bundle.products import LEAST_LEAD


@dataclass(frozen=True)
class Limits:
    """What counts as lost, as changed, as known, and as room to move.

    Attributes:
        position_m: a belief farther than this from where the robot really was is off.
        yaw_rad: a heading off by more than this is off.
        lost_s: off for at least this long is lost.
        changed_share: more changed beams than this share of the valid ones contradict the map.
        changed_s: contradicted for at least this long is changed.
        bridge_s: interruptions shorter than this do not end an interval.
        total_s: lost (or changed) for this long in all makes the log a lost (or changed) one.
        margin: hindsight whose best sequence of places beats the best different one by less than
            this mean score per scan cannot tell them apart.
        lead: an unjudged moment whose place beats the best different one by less than this mean
            score of its stretch is unobservable rather than short of data; hindsight's own limit.
        fits_from: a log whose typical scan scores less (0 to 1) fits nowhere in the map.
        fits_well_from: one that scores less than this fits only if the best sequence of places
            beats the best different one by `clear_margin`.
        clear_margin: mean score per scan; see `fits_well_from` and `disagreement`.
        disagreement: without a clear margin, hindsight that moves otherwise than odometry at more
            than this share of the moments does not fit either.
        match_ratio: a moment whose scan scores less than this part of the log's typical score,
            changed beams not counted against it, is not judged.
        frame_offset_m: a constant offset of belief against hindsight from here on is reported as
            a shifted map.
        frame_offset_rad: the same for a turned one.
        gate_sigmas: standard deviations that must fit into the clearance.
        stale_s: a belief older than this is stale when it is acted on.
        footprint_radius_m: used where the log's costmap does not tell the robot's inscribed radius.
    """

    position_m: float = 0.5
    yaw_rad: float = math.radians(20.0)
    lost_s: float = 3.0
    changed_share: float = 0.08
    changed_s: float = 2.0
    bridge_s: float = 1.0
    total_s: float = 5.0
    margin: float = 0.01
    lead: float = LEAST_LEAD
    fits_from: float = 0.35
    fits_well_from: float = 0.7
    clear_margin: float = 0.1
    disagreement: float = 0.15
    match_ratio: float = 0.35
    frame_offset_m: float = 0.2
    frame_offset_rad: float = math.radians(3.0)
    gate_sigmas: float = 3.0
    stale_s: float = 1.0
    footprint_radius_m: float = 0.25
