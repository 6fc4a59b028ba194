"""Loop closures as they are found, taken or not."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from slamreplay.geometry import se2
from slamreplay.graph.relations import Relations


@dataclass(frozen=True, eq=False)
class Candidate:
    """A place that was found for a submap, taken or not.

    Attributes:
        old: submap that it was laid on.
        new: submap that was laid.
        xyyaw: (3,) the new one's reference seen from the old one's.
        cov: (3, 3) of it, about axes of the old one.
        score: 0 to 1.
        residual: (3,) measured minus predicted.
        S: (3, 3) covariance predicted for it: of the prediction and of the match.
        nis: r' S^-1 r.
        yaw: heading of the old one's reference at that time, rad; it turns axes into the graph's.
        accepted: whether the graph took it in.
        moved: (3,) by how much the new submap moved when it was taken in; NaN where it waited for
            others, with which it was taken in later.
    """

    old: int
    new: int
    xyyaw: se2.Array
    cov: se2.Array
    score: float
    residual: se2.Array
    S: se2.Array
    nis: float
    yaw: float = 0.0
    accepted: bool = False
    moved: se2.Array = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True, eq=False)
class Closed:
    """What a pass over the submaps found.

    Attributes:
        candidates: in the order in which they were found.
        belief: (C, 3) where each submap's reference was believed to be once it was done.
        belief_cov: (C, 3, 3) of it, about the parent's axes; empty where not asked for.
        poses: (C, 3) where all are at the end.
        loosened: (C - 1,) ratios by which covariances of the motions grew.
    """

    candidates: tuple[Candidate, ...]
    belief: se2.Array
    belief_cov: se2.Array
    poses: se2.Array
    loosened: se2.Array

    def relations(self) -> Relations:
        """The accepted ones, between submaps."""
        return relations_of([c for c in self.candidates if c.accepted])


def relations_of(candidates: list[Candidate]) -> Relations:
    """Candidates as relations between submaps."""
    if not candidates:
        return Relations.none()
    return Relations(
        np.array([[c.old, c.new] for c in candidates]),
        np.array([c.xyyaw for c in candidates]),
        np.array([c.cov for c in candidates]),
    )
