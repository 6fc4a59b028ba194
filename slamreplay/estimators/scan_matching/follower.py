"""One scan after another laid onto the map of those before it.

A little longer than most: the state of one pass and every step that changes it stand together.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from slamreplay.estimators.scan_matching import fusion, rescue
from slamreplay.estimators.scan_matching.config import MatchConfig
from slamreplay.estimators.scan_matching.fit import Fit
from slamreplay.geometry import se2
from slamreplay.matching.field import ScoreField
from slamreplay.matching.line_map import LineMap, align
from slamreplay.matching.line_target import LineTarget, line_target

#: Scans with fewer points are not matched.
LEAST_POINTS = 10
#: Another place must fit this much better than the one that was found first.
GAIN = 0.05
#: Innovations beyond this (chi-square of 3) are looked into.
DOUBTED_NIS = 40.0
#: Beyond this odometry missed what the scan moved by.
REFUTED_NIS = 16.0
#: Where no odometry tells a step the speed of before is expected: it is known to this part, and to
#: this at the least, m and rad.
GUESS_PART, GUESS_M, GUESS_RAD = 0.5, 0.03, 0.03
#: How fast the pace follows, and how much of it is kept from scan to scan: along a corridor nothing
#: else would ever slow it down.
PACE_RATE, PACE_KEPT = 0.7, 0.97
#: Where odometry has a gap, to these.
BRIDGED_PART, BRIDGED_M, BRIDGED_RAD = 0.5, 0.02, 0.02
#: What a scan's pose misses that nothing else shows, at the least, m and rad.
JITTER_M, JITTER_RAD = 0.001, 0.0005
#: Odometry that is refuted more often than this of late predicts nothing: it may be stale, or tell
#: reverse driving as forward. How fast that is learned.
DISTRUSTED, TRUSTED, DISTRUST_RATE = 0.5, 0.05, 0.1
#: How fast what odometry does not tell is learned. A sweep laid out by the last motion alone would
#: swing up: an error of it makes one of the next with the other sign, and of about its size. Less
#: than this, m and rad, is not told from errors of matches.
STEADY_RATE, UNSAID_M, UNSAID_RAD = 0.25, 0.02, 0.015
#: How fast the typical score and spread follow.
RATE = 0.02
#: A point's standard deviation about its line is not less than this, m.
FINEST_M = 0.005
#: A node that brings less new than this share drifts as if it did.
LEAST_NEW = 0.01
MOST_STEPS = 20


_LIKELY = (fusion.LIKELY_FACTOR, fusion.LIKELY_FACTOR_YAW, fusion.FIRST_SCANS)


@dataclass(eq=False)
class Follower:
    """What is carried from scan to scan.

    Attributes:
        config: hyper-parameters.
        map: lines of the nodes so far, forgotten where they were not seen again.
        pose: (3,) of the last scan.
        cov: (3, 3) of it against the last node, about axes of the local frame.
        carried: (3, 3) of it, had nothing been matched since.
        pace: (3,) motion from scan to scan of late, in the axes of the base.
        unsaid: (3,) what odometry did not tell of it, over the last scans; all of it where there is
            none.
        learned: (3,) what odometry misses, as in `fusion.predict`.
        typical: score of the last matches.
        variance: of a point about its line in them, m^2.
        matches: how many were taken so far.
        lost: how many scans one after another matched nothing.
        is_refuted: prediction and the last scan told of different motions.
        distrust: how often scans refuted odometry of late, 0 to 1.
    """

    config: MatchConfig
    pose: se2.Array = field(default_factory=lambda: np.zeros(3))
    cov: se2.Array = field(default_factory=lambda: np.zeros((3, 3)))
    carried: se2.Array = field(default_factory=lambda: np.zeros((3, 3)))
    pace: se2.Array = field(default_factory=lambda: np.zeros(3))
    unsaid: se2.Array = field(default_factory=lambda: np.zeros(3))
    learned: se2.Array = field(default_factory=lambda: np.array(_LIKELY))
    typical: float = 0.85
    variance: float = 0.02**2
    matches: int = 0
    lost: int = 0
    is_refuted: bool = False
    distrust: float = 0.0

    def __post_init__(self) -> None:
        c = self.config
        self.map = LineMap.empty(c.memory)
        self._per_way = np.array([
            c.position_per_metre, c.position_per_turn, c.heading_per_metre, c.heading_per_turn
        ])  # fmt: skip
        self._prior, self._noise, self._told = np.empty(3), np.empty(4), np.empty(30)
        self._expected, self._held, self._jitter = (np.empty((3, 3)) for _ in range(3))
        self._step = np.zeros(3)
        self._room, self._sums = np.empty((3, 3, 3)), np.empty((4, 3))
        self._field: ScoreField | None = None
        self._target: LineTarget | None = None

    def begin(self, points: se2.Array, normals: se2.Array) -> None:
        """A new map, of one scan at the present pose."""
        self.map.clear()
        self.map.add(self.pose, points, normals)
        self._start_node()

    def _start_node(self) -> None:
        self.cov, self.carried = np.zeros((2, 3, 3))
        self.lost, self._field, self._target = 0, None, None

    def add_node(self, points: se2.Array, normals: se2.Array) -> tuple[se2.Array, se2.Array]:
        """Put the last scan into the map.

        The map drifts by a node's error as far as the node brings new lines: where it shows what
        is there already, the next one is laid onto the same as it was.

        Returns:
            Covariances (3, 3) of the map's drift since the node before, and of what the scan
            misses by itself.
        """
        new = self.map.add(self.pose, points, normals)
        drift = np.empty((3, 3))
        held = self._told[21:].reshape(3, 3) / max(new, LEAST_NEW)
        fusion.both(self.carried, held, drift, self._room)
        own = self.cov - drift
        self._start_node()
        return drift, own

    def follow(
        self, step: se2.Array, points: se2.Array, normals: se2.Array, *, is_bridged: bool
    ) -> Fit:
        """Match a scan and move on to it.

        Args:
            step: (3,) motion by odometry, NaN where not told.
            points: (P, 2) of the scan in its base frame.
            normals: (P, 2).
            is_bridged: the step is a part of a gap.
        """
        before = self.pose
        prior = self._predicted(step, is_bridged=is_bridged)
        if len(points) < LEAST_POINTS:
            return self._missed(prior, np.nan)
        pose, score, nis = self._laid(points, normals, prior)
        # Odometry that is wrong for long is no news.
        if self._is_doubted(score) or (nis > DOUBTED_NIS and not self.is_refuted):
            pose, score, nis = self._searched(points, normals, before, (pose, score, nis))
        if score < self.config.poor * self.typical:
            return self._missed(prior, score)
        return self._accepted(prior, pose, score, nis)

    def in_sweep(self, during: se2.Array, part: float, *, is_told: bool) -> se2.Array:
        """Motion (3,) in a sweep, of which odometry tells `during` (3,).

        Wheels that stand while the robot is carried leave its sweeps smeared.

        Args:
            during: zero where nothing is told.
            part: of the time between two scans.
            is_told: whether odometry told it.
        """
        way, turn = _size(self.unsaid)
        if is_told and way < UNSAID_M and turn < UNSAID_RAD:
            return during
        return np.asarray(during + part * self.unsaid)

    def _predicted(self, step: se2.Array, *, is_bridged: bool) -> se2.Array:
        least, self._step = _LEAST, np.where(np.isfinite(step), step, 0.0)
        if step[0] != step[0] or self.distrust > DISTRUSTED:
            step = self.pace
            least = GUESS_PART * _size(step) + (GUESS_M, GUESS_RAD)
        elif is_bridged:
            least = BRIDGED_PART * _size(step) + (BRIDGED_M, BRIDGED_RAD)
        before, prior = self.pose, self._prior
        fusion.predict(
            before, self.cov, step, self._per_way, self.learned, least,
            prior, self._noise, self._expected, self._held,
        )  # fmt: skip
        fusion.late(prior, step, self.config.late_part, _JITTER, self._jitter)
        dx, dy = prior[0] - before[0], prior[1] - before[1]
        fusion.carry_on(self.carried, dx, dy, self._noise, self._room)
        return prior.copy()

    def _laid(
        self, points: se2.Array, normals: se2.Array, start: se2.Array
    ) -> tuple[se2.Array, float, float]:
        """Where the scan lies best near `start` (3,), its score, and r' S^-1 r."""
        c, pose = self.config, start.copy()
        variance = max(self.variance, FINEST_M**2) * c.points_per_fact
        if c.icp == "open3d":
            pose = self._registered(points, pose)
        score, self._squares, trust = align(
            self.map.tags, self.map.lines, self.map.now - c.memory, points, normals, pose,
            self._prior, self._held, c.sigma_m, variance, MOST_STEPS * (c.icp == "native"),
            self._sums,
        )  # fmt: skip
        if c.icp == "open3d":
            held = self._held + self._sums[:3] / variance
            pose += np.linalg.solve(held, self._held @ _off(self._prior, pose))
        pose[2] = se2.wrap_angle(pose[2])
        nis = fusion.fuse(
            self._prior, self._expected, self._held, trust, self._noise, pose, self._sums,
            variance, self._jitter, self._told, self._room,
        )  # fmt: skip
        return pose, score, nis

    def _registered(self, points: se2.Array, start: se2.Array) -> se2.Array:
        """(3,) where Open3D puts the scan on the map's points."""
        from slamreplay.matching.open3d_icp import icp_open3d

        if self._target is None:
            self._target = line_target(self.map.points(self.pose[:2], rescue.RADIUS_M))
        return icp_open3d(self._target, points, start).xyyaw

    def _searched(
        self,
        points: se2.Array,
        normals: se2.Array,
        before: se2.Array,
        best: tuple[se2.Array, float, float],
    ) -> tuple[se2.Array, float, float]:
        """The best of `_laid` from where a wider search finds the scan, if better than `best`."""
        told, squares = self._told.copy(), self._squares
        for place in self._places(points, before):
            found = self._laid(points, normals, place)
            if found[1] > best[1] + GAIN:
                best, told, squares = found, self._told.copy(), self._squares
            if not self._is_doubted(best[1]):
                break
        self._told, self._squares = told, squares
        return best

    def _places(self, points: se2.Array, before: se2.Array) -> Iterator[se2.Array]:
        """Where the scan might lie (3,): at the speed of before, then wherever it is found."""
        yield se2.compose(before, self.pace)
        if self._field is None:
            self._field = rescue.search_field(self.map, before)
        if self._field is not None:
            yield from rescue.places(self._field, points, self._prior, before)

    def _is_doubted(self, score: float) -> bool:
        return score < self.config.doubted * self.typical

    def _accepted(self, prior: se2.Array, pose: se2.Array, score: float, nis: float) -> Fit:
        told, moved = self._told, _off(pose, prior)
        self.is_refuted = nis > REFUTED_NIS
        self._judge_odometry(pose)
        if self.is_refuted:  # wheels that slip, a robot that is carried
            self.carried += np.outer(moved, moved)
        fusion.both(self.carried, told[12:21].reshape(3, 3), self.cov, self._room)
        fusion.learn(self._noise, told, self.learned)
        self.matches += 1
        rate = max(RATE, 1.0 / (1.0 + self.matches))
        self.typical += rate * (score - self.typical)
        self.variance += RATE * (self._squares - self.variance)
        self.lost = 0
        (x, y, yaw), c, s = _off(pose, self.pose), np.cos(self.pose[2]), np.sin(self.pose[2])
        motion = np.array([c * x + s * y, c * y - s * x, yaw])
        self.pace = PACE_KEPT * (self.pace + PACE_RATE * (motion - self.pace))
        unsaid = np.clip(motion - self._step, -_MOST_UNSAID, _MOST_UNSAID)
        self.unsaid += STEADY_RATE * (unsaid - self.unsaid)
        self.pose = pose
        S = told[3:12].reshape(3, 3).copy()
        return Fit(pose, told[:3].copy(), S, score, accepted=True, moved=moved)

    def _judge_odometry(self, pose: se2.Array) -> None:
        """Learn whether odometry is right, where the match would tell it from standing still."""
        if not self.is_refuted and self.distrust < TRUSTED:
            return
        way, turn = _size(self._step)
        noise = self._per_way[::2] ** 2 * way + self._per_way[1::2] ** 2 * turn + _LEAST**2
        S = np.linalg.inv(self._told[12:21].reshape(3, 3)) + np.diag(noise[[0, 0, 1]])
        told = se2.compose(self.pose, self._step)
        both = np.stack([_off(pose, told), _off(told, self.pose)])
        wrong, moved = (both.T * np.linalg.solve(S, both.T)).sum(axis=0)
        if max(wrong, moved) > REFUTED_NIS:
            self.distrust += DISTRUST_RATE * ((wrong > REFUTED_NIS) - self.distrust)

    def _missed(self, prior: se2.Array, score: float) -> Fit:
        """Go on by odometry alone."""
        self.pose = prior
        self.cov = self.carried.copy()
        self.pace, self.unsaid = np.zeros(3), np.zeros(3)
        residual, S = np.full(3, np.nan), np.full((3, 3), np.nan)
        if score == score:
            self.lost += 1
            residual, S = self._told[:3].copy(), self._told[3:12].reshape(3, 3).copy()
        return Fit(prior, residual, S, score, accepted=False, moved=np.zeros(3))


def _size(step: se2.Array) -> se2.Array:
    """(2,) way and turn of a step."""
    return np.array([np.hypot(step[0], step[1]), abs(step[2])])


def _off(pose: se2.Array, other: se2.Array) -> se2.Array:
    off = pose - other
    off[2] = se2.wrap_angle(off[2])
    return off


#: Odometry that begins anew tells of nothing that happened, m, m and rad.
_MOST_UNSAID = np.array([0.5, 0.5, 0.5])
_LEAST = np.array([fusion.LEAST_M, fusion.LEAST_RAD])
_JITTER = np.array([JITTER_M, JITTER_RAD])
