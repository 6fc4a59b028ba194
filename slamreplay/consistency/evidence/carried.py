"""A belief carried by odometry to the moment at which something was sensed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import composed
from slamreplay.geometry.times import ns

#: Part of the way and of the turn that odometry may miss over some seconds, one sigma.
SLIP = 0.05


@dataclass(frozen=True, eq=False)
class Carried:
    """M sensed things, each where one update of a belief puts it.

    Attributes:
        update: (M,) rows of the updates, ascending.
        sensed: (M,) rows of what was sensed.
        places: (M, 3) the thing in the belief's frame; the heading is NaN where none was sensed.
        cov: (M, 3, 3) the update's, projected, plus that of the way between and of the sensor.
    """

    update: NDArray[np.int64]
    sensed: NDArray[np.int64]
    places: se2.Array
    cov: se2.Array

    def take(self, index: NDArray[np.int64] | NDArray[np.bool_]) -> Carried:
        """The rows at an index array or under a mask."""
        return Carried(self.update[index], self.sensed[index], self.places[index], self.cov[index])


def carried(
    updates: PoseTrack,
    motion: PoseTrack | None,
    t_ns: NDArray[np.int64],
    name: NDArray[np.object_],
    xyyaw: se2.Array,
    cov: se2.Array,
    within_s: float,
) -> Carried:
    """Where the updates of a belief put what was sensed in the robot's base.

    An update is carried over the time between by odometry, never extrapolated; its covariance is
    held, for the next update would be the same evidence again. Of each thing an update counts with
    the sighting that is nearest in time, and a sighting with the update that is nearest to it.

    Args:
        updates: (U,) the belief, sorted by time.
        motion: the base in a frame that drifts slowly; without it only what was sensed at the very
            moment of an update is used.
        t_ns: (N,) when things were sensed.
        name: (N,) which thing.
        xyyaw: (N, 3) the thing in the base.
        cov: (N, 3, 3) about axes of the base.
        within_s: an update is carried no farther than this.
    """
    update, sensed = _nearest(updates, t_ns, name, ns(within_s))
    step, covered = driven(motion, updates.t_ns[update], t_ns[sensed])
    known = np.isfinite(step).all(axis=1)
    update, sensed, step, covered = update[known], sensed[known], step[known], covered[known]
    slip = (SLIP * covered[:, :, None]) ** 2 * np.eye(3)
    seen, from_update = xyyaw[sensed], se2.compose(step, xyyaw[sensed])
    places = se2.compose(updates.xyyaw[update], from_update)
    own = composed(step, slip, seen, cov[sensed])
    whole = composed(updates.xyyaw[update], updates.cov[update], from_update, own)
    return Carried(update, sensed, places, whole)


def driven(
    motion: PoseTrack | None, from_ns: NDArray[np.int64], to_ns: NDArray[np.int64]
) -> tuple[se2.Array, se2.Array]:
    """Steps (M, 3) of the base between times (M,), NaN where odometry does not tell; and the way.

    The way (M, 3) is what was driven along x and y (both the same), in m, and turned, in rad,
    forth and back counted: odometry slips by that, not by the step that was gained.
    """
    still = from_ns == to_ns
    step, covered = np.zeros((len(still), 3)), np.zeros((len(still), 3))
    if motion is None or not len(motion):
        step[~still] = np.nan
        return step, covered
    step[~still] = se2.between(motion.at(from_ns).xyyaw, motion.at(to_ns).xyyaw)[~still]
    steps = np.abs(se2.between(motion.xyyaw[:-1], motion.xyyaw[1:]))
    steps[:, :2] = np.hypot(steps[:, 0], steps[:, 1])[:, None]
    so_far = np.vstack([np.zeros(3), np.cumsum(np.nan_to_num(steps), axis=0)])
    since, (start, end) = (
        motion.t_ns - motion.t_ns[0],
        (t - motion.t_ns[0] for t in (from_ns, to_ns)),
    )
    for axis in range(3):
        way = np.interp(end, since, so_far[:, axis]) - np.interp(start, since, so_far[:, axis])
        covered[:, axis] = np.abs(way)
    return step, covered


def _nearest(
    updates: PoseTrack, t_ns: NDArray[np.int64], name: NDArray[np.object_], within_ns: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of updates and of sightings that are each other's nearest, of each thing."""
    usable = np.flatnonzero(updates.has_pose & np.isfinite(updates.cov).all(axis=(1, 2)))
    none = np.empty(0, dtype=np.int64)
    if not len(usable) or not len(t_ns):
        return none, none
    at = updates.t_ns[usable]
    after = np.clip(np.searchsorted(at, t_ns), 0, len(at) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(at[before] - t_ns) <= np.abs(at[after] - t_ns), before, after)
    away = np.abs(at[nearest] - t_ns)
    _, thing = np.unique(name.astype(str), return_inverse=True)
    order = np.lexsort((away, thing, nearest))
    order = order[away[order] <= within_ns]
    pair = np.column_stack([nearest[order], thing[order]])
    first = np.append(True, (pair[1:] != pair[:-1]).any(axis=1))[: len(pair)]
    return usable[nearest[order[first]]], order[first]
