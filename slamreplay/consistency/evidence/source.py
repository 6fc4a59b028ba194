"""A belief's errors against something that is not the belief."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.evidence.spatial_track import SpatialTrack
from slamreplay.geometry.se2 import Array

#: Kinds that are made of evidence which the belief used as well: they may show that it is too sure
#: of itself, and never that its covariance is right.
SHARED_KINDS = frozenset({"hindsight", "second_odometry"})

#: Axes of errors in the map's frame, position first; of a thing that has no heading the first two.
MAP_AXES = ("x m", "y m", "yaw rad")
#: Axes of errors in space: a rotation vector about the axes of the map's frame.
SPATIAL_AXES = ("x m", "y m", "z m", "rx rad", "ry rad", "rz rad")


@dataclass(frozen=True, eq=False)
class Reference:
    """Base in map from one source, and what kind of source that is.

    Attributes:
        kind: simulation, motion_capture, ...
        source: its topic, or its kind again.
        track: of the base, in the plane.
        spatial: of the base in space; None of a source that never leaves the plane.
    """

    kind: str
    source: str
    track: PoseTrack
    spatial: SpatialTrack | None = None

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
        cov: (N, m, m) claimed for it: the belief's, projected, plus the source's own; NaN where the
            error is not to be held against it.
        axes: names and units of the m components.
        at_most: why `cov` is more than the errors can have: a sensor's noise was taken at its usual
            most, or errors that share a cause were added up. Such evidence may show that a belief
            is too sure of itself, and neither the reverse nor that it is right. Empty where `cov`
            is what is claimed.
        note: what else a reader of its numbers must know; may be empty.
        refusal: why there are no errors although the source is there; empty where there are.
    """

    source: str
    kind: str
    t_ns: NDArray[np.int64]
    error: Array
    cov: Array
    axes: tuple[str, ...]
    at_most: str = ""
    note: str = ""
    refusal: str = ""

    @classmethod
    def refused(cls, source: str, kind: str, why: str) -> Evidence:
        """A source that is there and cannot be used."""
        none = np.empty(0, dtype=np.int64)
        return cls(source, kind, none, np.empty((0, 2)), np.empty((0, 2, 2)), MAP_AXES[:2],
                   refusal=why)  # fmt: skip

    @property
    def shared(self) -> bool:
        """Whether it is made of evidence that the belief used too."""
        return self.kind in SHARED_KINDS

    @property
    def is_exact(self) -> bool:
        """Whether errors of a belief that is right have `cov`, neither less nor more."""
        return not (self.shared or self.at_most or self.refusal)
