"""One scan after another laid onto the map of those before it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from slamreplay.estimators.scan_matching import fusion, rescue
from slamreplay.estimators.scan_matching.config import MatchConfig
from slamreplay.geometry import se2
from slamreplay.matching.field import ScoreField
from slamreplay.matching.line_map import LineMap, align

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
#: Where odometry has a gap, to these.
BRIDGED_PART, BRIDGED_M, BRIDGED_RAD = 0.5, 0.02, 0.02
#: What a scan's pose misses that nothing else shows, at the least, m and rad.
JITTER_M, JITTER_RAD = 0.001, 0.0005
#: How fast the typical score and spread follow.
RATE = 0.02
#: Bounds of a point's standard deviation about its line, m.
FINEST_M = 0.005


@dataclass(frozen=True, eq=False)
class Fit:
    """How a scan came to its pose: rows of the ledger.

    Attributes:
        pose: (3,).
        residual: (3,) match minus prediction; NaN where nothing was matched.
        S: (3, 3) its covariance.
        score: 0 to 1; NaN where nothing was matched.
        accepted: whether the match was used.
        moved: (3,) pose minus prediction.
    """

    pose: se2.Array
    residual: se2.Array
    S: se2.Array
    score: float
    accepted: bool
    moved: se2.Array


@dataclass(eq=False)
class Follower:
    """What is carried from scan to scan.

    Attributes:
        config: hyper-parameters.
        pose: (3,) of the last scan.
        cov: (3, 3) of it against the last node.
        drift: (3, 3) of what of its error the map takes on: much of a match's error is gone with the
            next, for a node is laid onto many.
        carried: (3, 3) of it, had nothing been matched since.
    """

    config: MatchConfig
    pose: se2.Array = field(default_factory=lambda: np.zeros(3))
    cov: se2.Array = field(default_factory=lambda: np.zeros((3, 3)))
    drift: se2.Array = field(default_factory=lambda: np.zeros((3, 3)))
    carried: se2.Array = field(default_factory=lambda: np.zeros((3, 3)))
    motion: se2.Array = field(default_factory=lambda: np.zeros(3))
    learned: se2.Array = field(default_factory=lambda: np.array([1.0, 1.0, fusion.FIRST_SCANS]))
    typical: float = 0.85
    variance: float = 0.02**2
    lost: int = 0

    def __post_init__(self) -> None:
        c = self.config
        self.map = LineMap.empty(c.memory)
        self._per_way = np.array([
            c.position_per_metre, c.position_per_turn, c.heading_per_metre, c.heading_per_turn
        ])  # fmt: skip
        self._prior, self._noise, self._told = np.empty(3), np.empty(4), np.empty(30)
        self._jitter = np.empty((3, 3))
        self._expected, self._held = np.empty((3, 3)), np.empty((3, 3))
        self._room, self._sums = np.empty((3, 3, 3)), np.empty((3, 3))
        self._field: ScoreField | None = None

    def begin(self, points: se2.Array, normals: se2.Array) -> None:
        """A new map, of one scan at the present pose."""
        self.map.clear()
        self.add_node(points, normals)
        self.lost = 0

    def add_node(self, points: se2.Array, normals: se2.Array) -> se2.Array:
        """Put the last scan into the map; its covariance (3, 3) against the node before."""
        self.map.add(self.pose, points, normals)
        cov = self.drift.copy()
        self.cov[:] = self.drift[:] = 0.0
        self.carried[:] = 0.0
        self._field = None
        return cov

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
        least = self._least(step, is_bridged=is_bridged)
        if step[0] != step[0]:
            step = self.motion
        before = self.pose.copy()
        fusion.predict(
            before, self.cov, step, self._per_way, self.learned, least,
            self._prior, self._noise, self._expected, self._held,
        )  # fmt: skip
        fusion.late(self._prior, step, self.config.late_part, _JITTER, self._jitter)
        prior = self._prior.copy()
        fusion.carry_on(
            self.carried, prior[0] - before[0], prior[1] - before[1], self._noise, self._room
        )
        score, nis, pose = 0.0, np.inf, prior.copy()
        if len(points) >= LEAST_POINTS:
            score, nis = self._laid(points, normals, pose)
            if score < self.config.doubted * self.typical or nis > DOUBTED_NIS:
                score, nis, pose = self._searched(points, normals, before, pose, score, nis)
        poor = len(points) < LEAST_POINTS or score < self.config.poor * self.typical
        if poor:
            return self._missed(prior, score, matched=len(points) >= LEAST_POINTS)
        told = self._told
        off = pose - prior
        off[2] = se2.wrap_angle(off[2])
        if nis > REFUTED_NIS:  # wheels that slip, a robot that is carried
            self.carried += np.outer(off, off)
        fusion.both(self.carried, told[12:21].reshape(3, 3), self.cov, self._room)
        held = told[21:].reshape(3, 3) / self.config.drift_part
        fusion.both(self.carried, held, self.drift, self._room)
        self.typical += RATE * (score - self.typical)
        self.lost = 0
        self.pose = pose
        moved = pose - before
        c, s = np.cos(before[2]), np.sin(before[2])
        self.motion = np.array([
            c * moved[0] + s * moved[1], c * moved[1] - s * moved[0], se2.wrap_angle(moved[2])
        ])  # fmt: skip
        return Fit(pose, told[:3].copy(), told[3:12].reshape(3, 3).copy(), score, True, off)

    def _missed(self, prior: se2.Array, score: float, *, matched: bool) -> Fit:
        self.pose = prior
        self.cov, self.drift = self.carried.copy(), self.carried.copy()
        self.motion = np.zeros(3)
        self.lost += matched
        told = self._told
        if not matched:
            return Fit(prior, np.full(3, np.nan), np.full((3, 3), np.nan), np.nan, False, np.zeros(3))
        return Fit(
            prior, told[:3].copy(), told[3:12].reshape(3, 3).copy(), score, False, np.zeros(3)
        )

    def _least(self, step: se2.Array, *, is_bridged: bool) -> se2.Array:
        if step[0] != step[0]:
            way, turn = np.hypot(self.motion[0], self.motion[1]), abs(self.motion[2])
            return np.array([GUESS_M + GUESS_PART * way, GUESS_RAD + GUESS_PART * turn])
        if is_bridged:
            way, turn = np.hypot(step[0], step[1]), abs(step[2])
            return np.array([BRIDGED_M + BRIDGED_PART * way, BRIDGED_RAD + BRIDGED_PART * turn])
        return _LEAST

    def _laid(self, points: se2.Array, normals: se2.Array, pose: se2.Array) -> tuple[float, float]:
        """Score and r' S^-1 r of the scan, its `pose` moved to where it lies best."""
        c = self.config
        score, squares, trust = align(
            self.map.tags, self.map.lines, self.map.now - c.memory, points, normals, pose,
            self._prior, self._held, c.sigma_m, c.points_per_fact, self._sums,
        )  # fmt: skip
        pose[2] = se2.wrap_angle(pose[2])
        variance = max(self.variance, FINEST_M**2) * c.points_per_fact
        nis = fusion.fuse(
            self._prior, self._expected, self._held, trust, self._noise, pose, self._sums,
            variance, self._jitter, self.learned, self._told, self._room,
        )  # fmt: skip
        if score > c.poor * self.typical:
            self.variance += RATE * (squares - self.variance)
        return score, nis

    def _searched(
        self,
        points: se2.Array,
        normals: se2.Array,
        before: se2.Array,
        pose: se2.Array,
        score: float,
        nis: float,
    ) -> tuple[float, float, se2.Array]:
        if self._field is None:
            self._field = rescue.search_field(self.map, before)
        if self._field is None:
            return score, nis, pose
        learned, told = self.learned.copy(), self._told.copy()
        best = (score, nis, pose)
        for place in rescue.places(self._field, points, self._prior, before):
            trial = place.copy()
            found, odd = self._laid(points, normals, trial)
            if found > best[0] + GAIN:
                best, told = (found, odd, trial), self._told.copy()
            self.learned = learned.copy()
        self._told = told
        return best


_LEAST = np.array([fusion.LEAST_M, fusion.LEAST_RAD])
_JITTER = np.array([JITTER_M, JITTER_RAD])
