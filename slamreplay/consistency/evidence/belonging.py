"""Do the mean and the covariance that a particle filter published belong together?

nav2_amcl publishes the mean of its heaviest cluster with the covariance of the whole set
(amcl_node.cpp, pf.c). With one cluster they are the same; with two the errors of the one are
measured with the spread of both, and NEES means nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.consistency.evidence.clouds import clouds_in
from slamreplay.geometry import se2

#: A cloud speaks for the update that is no farther away than this.
NEAR_NS = 500_000_000
#: Above this share of the rows that can be judged NEES is refused altogether.
MOST = 0.5


@dataclass(frozen=True, eq=False)
class Belonging:
    """What is known of each update's particles.

    Attributes:
        t_ns: (N,) of the updates.
        seen: (N,) whether its particles, or how many clusters they made, are known.
        parted: (N,) whether mean and covariance are of different particles.
        words: of the most striking update, what they are of; empty where none is parted.
        at_ns: when that was.
    """

    t_ns: NDArray[np.int64]
    seen: NDArray[np.bool_]
    parted: NDArray[np.bool_]
    words: str = ""
    at_ns: int | None = None

    @property
    def left_out(self) -> NDArray[np.bool_]:
        """(N,) rows that NEES leaves out: the parted ones, all of them where they are most."""
        return np.ones_like(self.parted) if self.refusal else self.parted

    @property
    def refusal(self) -> str | None:
        """Why nothing is judged, None where it is."""
        parted, seen = int(self.parted.sum()), int(self.seen.sum())
        if not seen or parted <= MOST * seen:
            return None
        return f"in {parted} of {seen} updates mean and covariance are of different particles"


def several(clusters: se2.Array) -> NDArray[np.bool_]:
    """(N,) whether a mean of one of so many clusters (N,) is another thing than that of all."""
    return np.asarray(np.isfinite(clusters) & (clusters != 1.0))


def belonging_of_run(
    updates: PoseTrack, belief: PoseTrack, diagnostics: Mapping[str, se2.Array]
) -> Belonging | None:
    """Of a run that counts its `clusters` as the replayed AMCL does; None of any other."""
    if "clusters" not in diagnostics:
        return None
    order = np.argsort(belief.t_ns, kind="stable")
    row = np.searchsorted(belief.t_ns[order], updates.t_ns, side="right") - 1
    count = diagnostics["clusters"][order][np.maximum(row, 0)]
    seen, parted = np.isfinite(count), several(count)
    if not parted.any():
        return Belonging(updates.t_ns, seen, parted)
    worst = int(np.argmax(np.where(parted, count, -1.0)))
    some = f"{count[worst]:.0f} clusters" if count[worst] else "no cluster"
    words = f"{some} carried a tenth of the weight or more, the mean is the heaviest one's and "
    words += "the covariance that of all particles"
    return Belonging(updates.t_ns, seen, parted, words, int(updates.t_ns[worst]))


def belonging_of_robot(updates: PoseTrack, view: BundleView) -> Belonging | None:
    """Of the robot's own localizer, by the clouds in the log; None without any."""
    from slamreplay.consistency.evidence.cloud_parts import mixed_up  # loads numba

    clouds = clouds_in(view, updates.frame_id)
    if clouds is None:
        return None
    n = len(updates)
    seen, parted = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    worst, words, at_ns = 0.0, "", None
    for row, cloud in enumerate(_nearest(clouds, updates.t_ns).tolist()):
        if cloud < 0 or not np.isfinite(updates.xyyaw[row]).all():
            continue
        particles = np.asarray(clouds["xyyaw"][cloud], dtype=np.float64).reshape(-1, 3)
        weights = np.asarray(clouds["weights"][cloud], dtype=np.float64)
        judged = mixed_up(updates.xyyaw[row], updates.cov[row], particles, weights)
        if judged is None:
            continue
        seen[row], (parting, text) = True, judged
        parted[row] = parting > 0.0
        if parting > worst:
            worst, words, at_ns = parting, text, int(updates.t_ns[row])
    return Belonging(updates.t_ns, seen, parted, words, at_ns)


def _nearest(clouds: Table, t_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """(N,) row of the cloud nearest in time, -1 where none is near."""
    right = np.searchsorted(clouds.t_ns, t_ns)
    left, right = np.maximum(right - 1, 0), np.minimum(right, len(clouds) - 1)
    nearer = np.abs(clouds.t_ns[left] - t_ns) <= np.abs(clouds.t_ns[right] - t_ns)
    best = np.where(nearer, left, right)
    return np.where(np.abs(clouds.t_ns[best] - t_ns) <= NEAR_NS, best, -1)
