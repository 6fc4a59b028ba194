"""Loop closing while the way is driven: each finished submap is looked for among those before.

What is done at a submap depends on nothing after it, so that the same pass serves the online mode,
and tells how far each closure moved the belief when it was found.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from slamreplay.estimators.pose_graph.candidates import Candidate, Closed, relations_of
from slamreplay.estimators.pose_graph.config import GraphConfig
from slamreplay.estimators.pose_graph.placing import Searcher, information_of
from slamreplay.estimators.pose_graph.submaps import Submaps
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import composed, turned
from slamreplay.graph.online import OnlineGraph

#: A place is searched this many standard deviations about where it is expected, and a bit more.
SIGMAS, MARGIN_M, MARGIN_RAD = 3.0, 0.1, np.radians(2.0)
#: A heading that is known no better than to this may be any, rad.
ANY_HEADING = np.pi / 4.0
#: So many matches tell whether motions err more than they say; the median of chi-square of 3
#: degrees of freedom; and the largest ratio that is believed.
ENOUGH, MEDIAN, MOST_RATIO = 5, 2.366, 10.0
#: After so many searches of the whole map in vain it is searched once in so many submaps.
TRIES, SELDOM = 15, 5
#: Cells in which points of two submaps are the same place, m.
ALIKE_M = 0.2
#: Closures that confirm each other come from submaps at most so many apart.
TOGETHER = 6


def close_loops(
    maps: Submaps,
    first: se2.Array,
    first_cov: se2.Array,
    config: GraphConfig,
    match_scale: float = 1.0,
    with_cov: bool = False,
) -> Closed:
    """Look for every submap among those before it, in the order in which they were driven.

    Args:
        maps: the submaps.
        first: (3,) pose of the first one's reference.
        first_cov: (3, 3) of it.
        config: hyper-parameters.
        match_scale: ratio by which covariances of matches are changed.
        with_cov: whether the covariance of each belief is worked out.
    """
    closer = Closer(maps, OnlineGraph(first, first_cov), config, match_scale)
    belief, cov = [first], [first_cov]
    for new in range(1, len(maps)):
        closer.take(new)
        belief.append(closer.poses[new])
        if with_cov:
            cov.append(closer.graph.marginal(new) * closer.ratio)
    return Closed(
        tuple(closer.candidates[k] for k in sorted(closer.candidates)),
        np.array(belief),
        np.array(cov) if with_cov else np.empty((0, 3, 3)),
        closer.poses,
        closer.loosened * closer.ratio,
    )


class Closer:
    """The graph of submaps as it grows, and the closures that wait for others to confirm them.

    Args:
        maps: the submaps.
        graph: holds the first one.
        config: hyper-parameters.
        match_scale: ratio by which covariances of matches are changed.
    """

    def __init__(
        self, maps: Submaps, graph: OnlineGraph, config: GraphConfig, match_scale: float = 1.0
    ) -> None:
        self.maps, self.graph, self.config, self.match_scale = maps, graph, config, match_scale
        self.poses = graph.poses
        self.candidates: dict[int, Candidate] = {}  # by the new submap
        self.loosened = np.ones(len(maps) - 1)
        self.told: list[float] = []  # NIS of good matches, had the motions erred as they say
        self._waiting: list[int] = []
        self._not_before, self._in_vain = 0, 0  # when the whole map is searched next, and failures
        self._searcher = Searcher()
        self._last = maps.way[maps.stops[1:] - 1]  # way to the last node of each

    @property
    def ratio(self) -> float:
        """How many times larger the motions' covariances are than they say, by the matches so far.

        The median of their NIS over what it should be, so that a single slip does not count; never
        less than 1, for where matches err most themselves they tell nothing.
        """
        if len(self.told) < ENOUGH:
            return 1.0
        return float(np.clip(np.median(self.told) / MEDIAN, 1.0, MOST_RATIO))

    def take(self, new: int) -> None:
        """Add a submap to the graph, and look for it."""
        maps, config = self.maps, self.config
        self.graph.extend(maps.motion[new - 1], maps.motion_cov[new - 1])
        self.poses = np.vstack([self.poses, se2.compose(self.poses[-1], maps.motion[new - 1])])
        begin = maps.way[maps.stops[new]]
        old = np.flatnonzero(begin - self._last[:new] > config.apart_m)
        if not len(old):
            return
        away = self._away(old, self.poses[new])
        near = int(old[np.argmin(away)])
        S = self.graph.relative(self.poses, near, new) * self.ratio
        sigma = float(np.sqrt(np.linalg.eigvalsh(S[:2, :2])[-1]))
        reach_m, reach_rad = SIGMAS * sigma + MARGIN_M, SIGMAS * np.sqrt(S[2, 2]) + MARGIN_RAD
        reach_rad = np.pi if reach_rad > ANY_HEADING else float(reach_rad)
        reach_m = np.inf if reach_m > config.window_m else max(reach_m, config.least_window_m)
        known = old[away < config.reach_m + reach_m]
        if not len(known) or (np.isinf(reach_m) and new < self._not_before):
            return
        found = self._placed(new, near, known, reach_m, reach_rad)
        if np.isinf(reach_m):
            is_in_vain = found is None or found.score < config.min_score
            self._in_vain = self._in_vain + 1 if is_in_vain else 0
            self._not_before = new + (SELDOM if self._in_vain > TRIES else 1)
        if found is None:
            return
        self.candidates[new] = found
        if found.score >= config.min_score:
            self._judge(found, is_sure=sigma < config.sure_m and found.nis <= config.gate)

    def _away(self, old: NDArray[np.int64], pose: se2.Array) -> se2.Array:
        step = self.poses[old, :2] - pose[:2]
        return np.asarray(np.hypot(step[:, 0], step[:, 1]))

    def _placed(
        self, new: int, near: int, known: NDArray[np.int64], reach_m: float, reach_rad: float
    ) -> Candidate | None:
        """Search for a submap on the known ones, in axes of the near one; lay it on the likest."""
        poses, maps = self.poses, self.maps
        clouds = [
            se2.transform_points(pose, maps.clouds[k])
            for k, pose in zip(known, se2.between(poses[near], poses[known]), strict=True)
        ]
        expected = se2.between(poses[near], poses[new])
        place = self._searcher.best(
            np.concatenate(clouds),
            maps.clouds[new],
            expected,
            reach_m,
            reach_rad,
            self.config.min_score,
        )
        if place is None:
            return None
        there = se2.compose(poses[near], place.xyyaw)
        on = int(known[_most_alike(clouds, se2.transform_points(place.xyyaw, maps.clouds[new]))])
        cov = np.linalg.inv(information_of(place.information, self.config))
        cov = turned(cov, poses[near, 2] - poses[on, 2]) * self.match_scale
        left = self.config.closure_m, self.config.closure_m, self.config.closure_rad
        cov = cov + np.diag(np.square(left)) * self.match_scale
        z = se2.between(poses[on], there)
        residual = z - se2.between(poses[on], poses[new])
        residual[2] = se2.wrap_angle(residual[2])
        relative = self.graph.relative(poses, on, new)
        S = relative * self.ratio + cov
        nis = float(residual @ np.linalg.solve(S, residual))
        if place.score >= self.config.min_score:
            self.told.append(float(residual @ np.linalg.solve(relative + cov, residual)))
        return Candidate(on, new, z, cov, place.score, residual, S, nis, float(poses[on, 2]))

    def _judge(self, found: Candidate, *, is_sure: bool) -> None:
        agreeing: list[int] = []
        if not is_sure:
            self._waiting = [k for k in self._waiting if found.new - k <= TOGETHER]
            agreeing = [k for k in self._waiting if self._agree(self.candidates[k], found)]
            if len(agreeing) < self.config.confirmations:
                self._waiting.append(found.new)
                return
        taken = [*agreeing, found.new]
        self._waiting = [k for k in self._waiting if k not in agreeing]
        relations = relations_of([self.candidates[k] for k in taken])
        before = self.poses[found.new]
        since, ratio = self._against(found, max(self.candidates[k].nis for k in taken))
        self._loosen(since, found.new, ratio)
        numbers = self.graph.close(relations)
        self.poses = self.graph.poses
        if (relations.chi2(self.poses) > self.config.gate).any():
            self.graph.undo(numbers)  # what the others say of the same places speaks against it
            self._loosen(since, found.new, 1.0 / ratio)
            self.poses = self.graph.poses
            return
        moved = self.poses[found.new] - before
        moved[2] = se2.wrap_angle(moved[2])
        for k in taken:
            own = moved if k == found.new else np.full(3, np.nan)
            self.candidates[k] = replace(self.candidates[k], accepted=True, moved=own)

    def _against(self, found: Candidate, nis: float) -> tuple[int, float]:
        """From which submap on the motions are trusted less, and the ratio of their covariances.

        Closures that agree with each other speak against them. It is those since the last closure:
        what was tied up before has been confirmed. The covariance grows by the variance factor
        NIS / 3, after which the closures are as expected.
        """
        tied = [c.new for c in self.candidates.values() if c.accepted]
        return max([found.old, *tied]), nis / 3.0 if nis > self.config.gate else 1.0

    def _loosen(self, first: int, last: int, ratio: float) -> None:
        if ratio != 1.0:
            self.graph.loosen(first, last, ratio)
            self.loosened[first:last] *= ratio

    def _agree(self, one: Candidate, two: Candidate) -> bool:
        """Whether two closures say the same of the motion between their submaps.

        They are held against each other around the loop of both (pairwise consistency: Mangelson,
        Dominic, Eustice, Vasudevan, ICRA 2018, eq. 4).
        """
        maps, poses = self.maps, self.poses
        motion = maps.between(one.new, two.new)
        since = maps.covariance(one.new, two.new) * self.ratio
        cov = composed(one.xyyaw, one.cov, motion, since)
        old = se2.between(poses[two.old], poses[one.old])
        z = se2.compose(old, se2.compose(one.xyyaw, motion))
        off = two.xyyaw - z
        off[2] = se2.wrap_angle(off[2])
        S = two.cov + turned(cov, old[2])
        if one.old != two.old:
            S = S + self.graph.relative(poses, two.old, one.old)
        return bool(off @ np.linalg.solve(S, off) < self.config.gate)


def _most_alike(clouds: list[se2.Array], cloud: se2.Array) -> int:
    """Which of some clouds has points in most of the cells that a cloud (M, 2) has points in."""
    own = _cells(cloud)
    return int(np.argmax([np.isin(_cells(other), own).sum() for other in clouds]))


def _cells(points: se2.Array) -> NDArray[np.int64]:
    cell = np.floor(points / ALIKE_M).astype(np.int64)
    return np.unique(cell[:, 0] * 10_000_019 + cell[:, 1])
