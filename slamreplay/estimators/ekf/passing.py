"""What the filter reads of a log, and what one pass over it makes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.track import PoseTrack
from slamreplay.estimators.ekf.observations import Observations
from slamreplay.estimators.start import Start
from slamreplay.geometry import se2


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the filter reads of a log.

    Attributes:
        odometry: base in odom.
        observations: of surveyed things.
        row_ns: (N,) times at which a pose is wanted, sorted.
        given: poses that somebody gave, at rows of `row_ns`, in order; the first is anywhere where
            nobody did.
    """

    odometry: PoseTrack
    observations: Observations
    row_ns: NDArray[np.int64]
    given: Sequence[Start]

    def of_starts(self) -> Evidence:
        """The same with rows only where poses were given."""
        rows = self.row_ns[[start.row for start in self.given]]
        given = [replace(start, row=k) for k, start in enumerate(self.given)]
        return replace(self, row_ns=rows, given=given)


@dataclass(frozen=True, eq=False)
class Filtered:
    """What the filter made of N rows and M observations.

    Attributes:
        xyyaw: (N, 3) base in map, NaN before the first start and where odometry is silent.
        cov: (N, 3, 3) covariance of it.
        updated: (N,) 1 where a sighting was taken in since the row before, NaN without a pose.
        residual: (M, 3) measured minus predicted range, bearing, heading; NaN where not used.
        S: (M, 3, 3) covariance predicted for it.
        status: (M,) `kernels.UNUSED`, ACCEPTED or REJECTED.
        located: how often the filter placed itself by sightings alone.
        recoveries: how often of these it had been lost.
        silent: observations at times at which odometry says nothing.
    """

    xyyaw: se2.Array
    cov: se2.Array
    updated: se2.Array
    residual: se2.Array
    S: se2.Array
    status: NDArray[np.int64]
    located: int
    recoveries: int
    silent: int
