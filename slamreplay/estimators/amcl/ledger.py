"""What an AMCL run leaves behind: its rows, and what each scan said against the prediction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.run import Estimate, Innovations
from slamreplay.bundle.track import PoseTrack
from slamreplay.estimators.amcl.filter import AmclFilter
from slamreplay.estimators.amcl.laser import Beams
from slamreplay.estimators.amcl.match import ScanMatcher
from slamreplay.geometry import se2

#: What the scans' innovations are of, and its units.
AXES = ("x m", "y m", "yaw rad")
_UNKNOWN = np.full(3, np.nan)


@dataclass(frozen=True, eq=False)
class _Judged:
    row: int
    rank: float
    before: se2.Array
    cov: se2.Array
    ends: se2.Array


class Ledger:
    """Collects a run scan by scan.

    Args:
        t_ns: (N,) times of all scans.
        T_odom_base: (N, 3) odometry there.
        frame_id: the map's frame.
    """

    def __init__(self, t_ns: NDArray[np.int64], T_odom_base: se2.Array, *, frame_id: str) -> None:
        self._t_ns, self._T_odom_base, self._frame_id = t_ns, T_odom_base, frame_id
        self._T_map_odom = _UNKNOWN
        self._events: list[tuple[int, se2.Array, se2.Array, float, float, float]] = []
        self._judged: list[_Judged] = []

    def begin(self, row: int, xyyaw: se2.Array | None) -> None:
        """A start at a pose (3,) at a row; None stands for anywhere."""
        if xyyaw is None:
            self._T_map_odom = _UNKNOWN
        else:
            self._T_map_odom = se2.compose(xyyaw, se2.inverse(self._T_odom_base[row]))

    def judge(self, row: int, rank: float, beams: Beams, amcl: AmclFilter) -> None:
        """A scan that is about to be taken in, by a filter that was moved to it."""
        before = se2.compose(self._T_map_odom, self._T_odom_base[row])
        self._judged.append(_Judged(row, rank, before, amcl.cov, beams.ends))

    def update(self, row: int, amcl: AmclFilter, *, is_published: bool) -> None:
        """A scan was taken in; the belief is that of before where nothing was published."""
        said = amcl.published
        if is_published:
            T_base_odom = se2.inverse(self._T_odom_base[row])
            self._T_map_odom = se2.compose(said.mean_xyyaw, T_base_odom)
        numbers = float(len(amcl.weights)), amcl.ess, float(said.clusters)
        self._events.append((row, self._T_map_odom, said.cov, *numbers))

    def estimate(
        self, rows: NDArray[np.int64], child_frame_id: str, matcher: ScanMatcher
    ) -> Estimate:
        """The run, at those rows that have odometry and come after the start.

        Scans are matched here, all at once: what the filter does hangs on none of that.
        """
        n = len(self._t_ns)
        xyyaw, cov = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
        names = ("updated", "particles", "ess", "clusters", "likelihood_quantile")
        columns = {name: np.full(n, np.nan) for name in names}
        if self._events:
            parts = zip(*self._events, strict=True)
            at, offsets, covs, *numbers = (np.array(part) for part in parts)
            latest = np.searchsorted(at, rows, side="right") - 1
            xyyaw[rows] = se2.compose(offsets[latest], self._T_odom_base[rows])
            cov[rows] = covs[latest]
            for name, column in zip(names[1:4], numbers, strict=True):
                columns[name][rows] = column[latest]
            columns["updated"][rows] = 0.0
            columns["updated"][at] = 1.0
        for one in self._judged:
            columns["likelihood_quantile"][one.row] = one.rank
        track = PoseTrack(self._frame_id, child_frame_id, self._t_ns, xyyaw, cov)
        return Estimate(track, self._innovations(xyyaw, matcher), columns)

    def _innovations(self, xyyaw: se2.Array, matcher: ScanMatcher) -> tuple[Innovations, ...]:
        if not self._judged:
            return ()
        at = np.array([j.row for j in self._judged])
        before = np.array([j.before for j in self._judged])
        found = matcher(before, [j.ends for j in self._judged])
        residual, moved = found.xyyaw - before, xyyaw[at] - before
        residual[:, 2], moved[:, 2] = se2.wrap_angle(residual[:, 2]), se2.wrap_angle(moved[:, 2])
        scan = Innovations(
            "scan",
            self._t_ns[at],
            residual,
            np.array([j.cov for j in self._judged]) + found.cov,
            np.ones(len(at), dtype=bool),
            AXES,
            self._frame_id,
            moved,
            score=found.score,
            is_predicted=False,
        )
        return (scan,)
