"""Sentences of evidence that more than one cause needs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slamreplay.bundle.products import Hindsight
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.verdict.belief_error import BeliefError
from slamreplay.verdict.judgement import Interval

#: What came first, in words for a shift lead.
BECAUSE = {
    "wrong_initial_pose": "its first pose was wrong",
    "odometry_slip": "its wheels slipped",
    "kidnapped": "it was moved by hand",
    "association_error": "it took one place for another",
    "sensing_ambiguity": "two places looked alike to it",
    "stale_map_use": "its map was no longer true",
    "overconfidence": "it was too sure of itself",
    "optimization_drift": "small errors added up",
    "timing": "its sensors came late or not at all",
}
#: An error of this many of the belief's own standard deviations is one it did not expect.
BOLD = 3.0


def square_metres(area_m2: float) -> str:
    """An area, with the digits that a chair leg or a box needs, too."""
    return f"{area_m2:.1f} m²" if area_m2 >= 0.95 else f"{area_m2:.2f} m²"


def bold_words(
    error: BeliefError, lost: Interval, sigma_m: se2.Array, start_ns: int
) -> tuple[str, ...]:
    """That the belief did not know how wrong it was; empty where it did, or told no covariance."""
    inside = (error.t_ns >= lost.start_ns) & (error.t_ns < lost.end_ns) & error.known
    with np.errstate(invalid="ignore", divide="ignore"):
        times = np.where(inside & (sigma_m > 0.0), error.distance_m / sigma_m, np.nan)
    if not np.isfinite(times).any():
        return ()
    row = int(np.nanargmax(times))
    if np.nanmedian(times) < BOLD:
        return ()
    t = (error.t_ns[row] - start_ns) / NS_PER_S
    own, real = f"{sigma_m[row]:.2f} m", f"{error.distance_m[row]:.2f} m"
    return (f"it did not know: at {t:.1f} s its own sigma was {own} and its error {real}",)


def changed_words(changed: Sequence[Interval], hindsight: Hindsight, start_ns: int) -> list[str]:
    """When what the robot saw contradicted the map, and the largest regions of it."""
    if not changed:
        return []
    words = [
        f"what the robot saw contradicted the map from {(i.start_ns - start_ns) / NS_PER_S:.1f} s "
        f"to {(i.end_ns - start_ns) / NS_PER_S:.1f} s"
        for i in changed[:3]
    ]
    regions = () if hindsight.changes is None else hindsight.changes.regions
    for region in sorted(regions, key=lambda r: -r.area_m2)[:3]:
        x, y = (region.bbox_m[0] + region.bbox_m[2]) / 2, (region.bbox_m[1] + region.bbox_m[3]) / 2
        words.append(f"{square_metres(region.area_m2)} {region.kind} around ({x:.1f}, {y:.1f})")
    return words
