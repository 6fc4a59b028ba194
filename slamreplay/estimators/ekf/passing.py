"""What the filter reads of a log, and what one pass over it makes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.fixes import SatelliteFixes
from slamreplay.bundle.track import PoseTrack
from slamreplay.estimators.ekf.gyro import Gyro
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
        gyro: turns that an inertial unit measured, None without one.
        fixes: places of the antenna in the map, None without a receiver that is tied to it.
        frame_id: of the poses, the map or, where nothing leads to it, the odometry's own.
    """

    odometry: PoseTrack
    observations: Observations
    row_ns: NDArray[np.int64]
    given: Sequence[Start]
    gyro: Gyro | None = None
    fixes: SatelliteFixes | None = None
    frame_id: str = "map"

    def of_starts(self) -> Evidence:
        """The same with rows only where poses were given."""
        rows = self.row_ns[[start.row for start in self.given]]
        given = [replace(start, row=k) for k, start in enumerate(self.given)]
        return replace(self, row_ns=rows, given=given)


@dataclass(frozen=True, eq=False)
class Held:
    """What N measurements of one kind were against the prediction.

    Attributes:
        t_ns: (N,) when.
        residual: (N, m) measured minus predicted; NaN where not used.
        S: (N, m, m) covariance predicted for it.
        status: (N,) `kernels.UNUSED`, ACCEPTED or REJECTED.
        moved: (N, 3) the pose after minus before, x y along the parent's axes, and yaw.
    """

    t_ns: NDArray[np.int64]
    residual: se2.Array
    S: se2.Array
    status: NDArray[np.int64]
    moved: se2.Array

    @classmethod
    def none(cls, t_ns: NDArray[np.int64], axes: int) -> Held:
        """Of measurements that nothing was held against so far, arrays to be filled in."""
        n = len(t_ns)
        residual, S = np.full((n, axes), np.nan), np.full((n, axes, axes), np.nan)
        return cls(t_ns, residual, S, np.zeros(n, dtype=np.int64), np.full((n, 3), np.nan))

    def part(self, first: int, end: int, axes: int) -> Held:
        """Those from `first` to before `end`, with their first axes."""
        residual, S = self.residual[first:end, :axes], self.S[first:end, :axes, :axes]
        return Held(
            self.t_ns[first:end], residual, S, self.status[first:end], self.moved[first:end]
        )


@dataclass(frozen=True, eq=False)
class Filtered:
    """What the filter made of N rows and M observations.

    Attributes:
        xyyaw: (N, 3) base in map, NaN before the first start and where odometry is silent.
        cov: (N, 3, 3) covariance of it.
        updated: (N,) 1 where a sighting or fix was taken in since the row before, NaN without a
            pose.
        sighted: the M observations: range, bearing, heading.
        fixed: the satellite fixes: x and y.
        turned: the turns of the wheels against those of the gyroscope.
        turns: (2,) at the end: the share that wheels lack of turns, and the bias of the gyroscope
            in rad/s; NaN without one.
        located: how often the filter placed itself by sightings alone.
        recoveries: how often of these it had been lost.
        silent: observations and fixes at times at which odometry says nothing.
    """

    xyyaw: se2.Array
    cov: se2.Array
    updated: se2.Array
    sighted: Held
    fixed: Held
    turned: Held
    turns: se2.Array
    located: int
    recoveries: int
    silent: int

    @property
    def residual(self) -> se2.Array:
        """(M, 3) of the observations, measured minus predicted range, bearing, heading."""
        return self.sighted.residual

    @property
    def S(self) -> se2.Array:
        """(M, 3, 3) covariance predicted for these."""
        return self.sighted.S

    @property
    def status(self) -> NDArray[np.int64]:
        """(M,) what became of each observation."""
        return self.sighted.status
