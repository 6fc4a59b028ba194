"""Belief against hindsight, moment by moment, and which moments can be judged at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2
from slamreplay.verdict.limits import Limits

#: Hindsight is never better than this, whatever its covariance says: half a map cell and a bit.
FLOOR_M, FLOOR_RAD = 0.05, np.radians(1.0)


@dataclass(frozen=True, eq=False)
class BeliefError:
    """What the belief was off by at every scan that hindsight has, in time order.

    Attributes:
        t_ns: (N,) scan times.
        belief: (N, 3) as believed, NaN before the first belief.
        where: (N, 3) as hindsight has it, NaN where it does not know.
        distance_m: (N,) between the two, NaN where either is missing.
        heading_rad: (N,) absolute difference in heading.
        sigma_m: (N,) hindsight's standard deviation along the difference. The belief's own is not
            in it: what the robot believed is known exactly, however unsure it was.
        sigma_rad: (N,) of the heading.
        known: (N,) moments at which hindsight can be trusted.
        spoken: (N,) moments from the first belief on.
    """

    t_ns: NDArray[np.int64]
    belief: se2.Array
    where: se2.Array
    distance_m: se2.Array
    heading_rad: se2.Array
    sigma_m: se2.Array
    sigma_rad: se2.Array
    known: NDArray[np.bool_]
    spoken: NDArray[np.bool_]

    def off(self, limits: Limits) -> NDArray[np.bool_]:
        """(N,) moments with the belief beyond the limits; False where unknown."""
        with np.errstate(invalid="ignore"):
            return np.asarray(
                (self.distance_m > limits.position_m) | (self.heading_rad > limits.yaw_rad)
            )


def belief_error(
    belief: PoseTrack | None, hindsight: Hindsight, limits: Limits, late_ns: int = 0
) -> BeliefError:
    """The belief at hindsight's scans; of no belief at all, every row is unspoken.

    Args:
        belief: base in map as believed.
        hindsight: base in map as it was.
        limits: what can be judged.
        late_ns: by how much later than measured the scans are stamped.
    """
    track = hindsight.track
    order = np.argsort(track.t_ns, kind="stable")
    track = track.take(order)
    if belief is None:
        empty = np.full((len(track), 3), np.nan)
        belief = PoseTrack.without_covariance(
            track.frame_id, track.child_frame_id, track.t_ns, empty
        )
    spoken = _from_first(belief, track.t_ns)
    there = belief.at(track.t_ns - late_ns)
    if late_ns:  # within the delay after its first word the belief of that moment held
        first = ~there.has_pose & spoken
        there = _first_of(there, belief.at(track.t_ns), first)
    step = there.xyyaw - track.xyyaw
    distance = np.hypot(step[:, 0], step[:, 1])
    sigma_m, sigma_rad = _sigma(step, track.cov)
    return BeliefError(
        track.t_ns,
        there.xyyaw,
        track.xyyaw,
        distance,
        np.abs(se2.wrap_angle(step[:, 2])),
        sigma_m,
        sigma_rad,
        judgeable(hindsight, limits)[order],
        spoken,
    )


def _first_of(there: PoseTrack, now: PoseTrack, rows: NDArray[np.bool_]) -> PoseTrack:
    xyyaw, cov = there.xyyaw.copy(), there.cov.copy()
    xyyaw[rows], cov[rows] = now.xyyaw[rows], now.cov[rows]
    return PoseTrack(there.frame_id, there.child_frame_id, there.t_ns, xyyaw, cov)


def judgeable(hindsight: Hindsight, limits: Limits) -> NDArray[np.bool_]:
    """(N,) rows of hindsight good enough to accuse somebody by.

    A pose, its own standard deviation within the limits, and a scan that the map explains not far
    worse than the log's typical one. Changed beams are not counted against the scan, or a changed
    aisle would excuse itself.
    """
    track = hindsight.track
    ok = track.has_pose
    with np.errstate(invalid="ignore"):
        variance = np.linalg.eigvalsh(np.nan_to_num(track.cov[:, :2, :2]))[:, -1]
        ok &= ~(variance > limits.position_m**2)
        ok &= ~(track.cov[:, 2, 2] > limits.yaw_rad**2)
        explained = explained_match(hindsight)
        typical = np.nanmedian(explained[ok]) if np.isfinite(explained[ok]).any() else np.nan
        ok &= ~(explained < limits.match_ratio * typical)
    return np.asarray(ok)


def explained_match(hindsight: Hindsight) -> se2.Array:
    """(N,) match of each scan over its unchanged beams, 0 to 1; NaN where it has none."""
    match = np.array(hindsight.match, dtype=np.float64)
    changes = hindsight.changes
    if changes is None or not len(changes.t_ns):
        return match
    at = np.clip(np.searchsorted(changes.t_ns, hindsight.track.t_ns), 0, len(changes.t_ns) - 1)
    share = np.where(changes.t_ns[at] == hindsight.track.t_ns, changes.changed_share[at], 0.0)
    share = np.clip(np.nan_to_num(share), 0.0, 0.9)
    return np.asarray(np.minimum(match / (1.0 - share), 1.0))


def _from_first(belief: PoseTrack, t_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    times = belief.t_ns[belief.has_pose]
    return t_ns >= times.min() if len(times) else np.zeros(len(t_ns), dtype=bool)


def _sigma(step: se2.Array, cov: se2.Array) -> tuple[se2.Array, se2.Array]:
    """Along the difference (N, 3) in the plane, and in heading; an unknown one is the floor."""
    length = np.maximum(np.hypot(step[:, 0], step[:, 1]), 1e-9)
    u = step[:, :2] / length[:, None]
    along = np.nan_to_num(np.einsum("ni,nij,nj->n", u, cov[:, :2, :2], u))
    turn = np.nan_to_num(cov[:, 2, 2])
    return (
        np.sqrt(np.maximum(along, 0.0) + FLOOR_M**2),
        np.sqrt(np.maximum(turn, 0.0) + FLOOR_RAD**2),
    )
