"""SR-MAP-WRONG: does the log fit anywhere in this map?

Another floor or another scale is seldom empty of places where a scan fits half-way, so no score
tells alone. In the right map a typical scan scores 0.8 and more, changed aisles included, and the
best sequence of places stands clear of every other; in the wrong one the score is mediocre and many
sequences are as mediocre, or the places only fit if the robot moved otherwise than its wheels say.
A map out of scale is told by the scale that fits (`slamreplay.hindsight.scale`): halls drawn a
tenth too large keep a clear margin.
Measured on 12 right and 29 wrong pairs of log and map (other places, mirrored, scales 0.8 to 1.3):
right ones score at least 0.83 with a margin of at least 0.12, wrong ones have a margin of at most
0.09.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.verdict.limits import Limits

#: Motions are compared over this stretch; they disagree beyond both of these.
STRETCH_NS, DISAGREE_M, DISAGREE_SHARE = 3 * NS_PER_S, 0.3, 0.1


@dataclass(frozen=True)
class MapFit:
    """How well the map explains the log.

    Attributes:
        typical: median score of the scans that have a place, None where none has.
        disagreement: share of moments at which hindsight moves otherwise than odometry; 0 where
            there is no odometry.
        fits: whether the verdict may be built on it.
        text: why not, with the numbers.
        scale: how many times larger than the place the map is drawn, where that is why.
    """

    typical: float | None
    disagreement: float
    fits: bool
    text: str
    scale: float | None = None


def map_fit(view: BundleView, hindsight: Hindsight, limits: Limits) -> MapFit:
    """Whether the map is of the place the log was recorded in."""
    match = hindsight.match[hindsight.track.has_pose]
    match = match[np.isfinite(match)]
    typical = float(np.median(match)) if len(match) else None
    if hindsight.scale is not None:
        text = f"the map is drawn {hindsight.scale:.2f} times as large as the place"
        return MapFit(typical, 0.0, fits=False, text=text, scale=hindsight.scale)
    if typical is None:
        return MapFit(None, 0.0, fits=False, text="no scan has a place in this map")
    disagreement = _disagreement(view, hindsight)
    clear = hindsight.margin is None or hindsight.margin >= limits.clear_margin
    if typical < limits.fits_from:
        text = f"a typical scan scores {typical:.2f} where {limits.fits_from:.2f} is needed"
        return MapFit(typical, disagreement, fits=False, text=text)
    if not clear and typical < limits.fits_well_from:
        text = f"a typical scan scores {typical:.2f} only, and as much in quite other places"
        return MapFit(typical, disagreement, fits=False, text=text)
    if not clear and disagreement > limits.disagreement:
        text = (
            f"the places that fit best ask for other motions than odometry's at "
            f"{100 * disagreement:.0f} % of the moments"
        )
        return MapFit(typical, disagreement, fits=False, text=text)
    return MapFit(typical, disagreement, fits=True, text="")


def _disagreement(view: BundleView, hindsight: Hindsight) -> float:
    odometry = odometry_track(view)
    if odometry is None or not len(odometry):
        return 0.0
    track = hindsight.track
    odom = odometry.at(track.t_ns).xyyaw
    rows = np.flatnonzero(track.has_pose & np.isfinite(odom).all(axis=1))
    if len(rows) < 2:
        return 0.0
    t, where, odom = track.t_ns[rows], track.xyyaw[rows], odom[rows]
    ahead = np.minimum(np.searchsorted(t, t + STRETCH_NS), len(t) - 1)
    told, made = se2.between(odom, odom[ahead]), se2.between(where, where[ahead])
    apart = np.hypot(*(told - made)[:, :2].T)
    far = np.hypot(*told[:, :2].T)
    return float((apart > np.maximum(DISAGREE_M, DISAGREE_SHARE * far)).mean())
