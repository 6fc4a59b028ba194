"""What a particle filter thought, beside what it told the robot: its cloud against hindsight."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.verdict.belief_error import BeliefError
from slamreplay.verdict.limits import Limits

#: So many clouds must speak, and this share of them be right.
FEWEST, RIGHT_SHARE = 20, 0.8


def right_cloud_m(
    view: BundleView, error: BeliefError, limits: Limits, low_ns: int, high_ns: int
) -> float | None:
    """Median distance in m of the clouds' centres from hindsight where most of them were right.

    None where the log has too few clouds between two times, or they were as wrong as the belief: a
    cloud that is right beside a belief that is wrong was not what the robot was told.

    Args:
        view: the log; clouds in other frames than the map are not asked.
        error: for where the robot was.
        limits: what counts as off.
        low_ns: from when on.
        high_ns: until when.
    """
    table = view.table("particles")
    keep = (table.t_ns >= low_ns) & (table.t_ns < high_ns)
    table = table.take(keep & (table["frame_id"] == (view.manifest.frames.map or "map")))
    known = error.known & np.isfinite(error.distance_m)
    if len(table) < FEWEST or known.sum() < 2:
        return None
    centres = np.array([_centre(cloud) for cloud in table["xyyaw"]])
    where = se2.interpolate(
        error.t_ns[known], error.where[known], _within(table.t_ns, error.t_ns[known])
    )
    metres = np.hypot(*(centres - where)[:, :2].T)
    radians = np.abs(se2.wrap_angle(centres[:, 2] - where[:, 2]))
    right = (metres <= limits.position_m) & (radians <= limits.yaw_rad)
    return float(np.nanmedian(metres)) if right.mean() >= RIGHT_SHARE else None


def _centre(cloud: NDArray[np.float64]) -> se2.Array:
    """(3,) median place and mean heading of particles (3 * M,): strays do not move it."""
    particles = np.asarray(cloud, dtype=np.float64).reshape(-1, 3)
    if not len(particles):
        return np.full(3, np.nan)
    x, y = np.median(particles[:, :2], axis=0)
    yaw = np.arctan2(np.sin(particles[:, 2]).mean(), np.cos(particles[:, 2]).mean())
    return np.array([x, y, yaw])


def _within(t_ns: NDArray[np.int64], known_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.clip(t_ns, known_ns[0], known_ns[-1])
