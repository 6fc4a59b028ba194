"""A belief's errors against something that is not the belief."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry.se2 import Array

#: Kinds that are made of evidence which the belief used as well: they may show that it is too sure
#: of itself, and never that its covariance is right.
SHARED_KINDS = frozenset({"hindsight", "second_odometry"})


@dataclass(frozen=True, eq=False)
class Reference:
    """Base in map from one source, and what kind of source that is."""

    kind: str
    source: str
    track: PoseTrack

    @property
    def shared(self) -> bool:
        """Whether it is made of evidence that the belief used too."""
        return self.kind in SHARED_KINDS


@dataclass(frozen=True, eq=False)
class Evidence:
    """Errors of a belief, each with the covariance that belief and source claim for it.

    Attributes:
        source: what the belief is held against, in words ("motion capture /truth", "dock_1").
        kind: of the reference; those of `SHARED_KINDS` never prove consistency.
        t_ns: (N,) times, sorted.
        error: (N, m) belief minus source in `axes`; NaN rows where either is missing.
        cov: (N, m, m) claimed for it: the belief's, projected, plus the source's own.
        axes: names and units of the m components.
    """

    source: str
    kind: str
    t_ns: NDArray[np.int64]
    error: Array
    cov: Array
    axes: tuple[str, ...]

    @property
    def shared(self) -> bool:
        """Whether it is made of evidence that the belief used too."""
        return self.kind in SHARED_KINDS
