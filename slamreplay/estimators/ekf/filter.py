"""The filter over a whole log: events in order of time, starts, and starting again when lost.

A little longer than most: the state of one pass and every step that changes it stand together.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from slamreplay.errors import UsageError
from slamreplay.estimators.ekf import kernels
from slamreplay.estimators.ekf.consensus import LEAST_AGREEING, locate, window_of
from slamreplay.estimators.ekf.motion import Motion, Steps
from slamreplay.estimators.ekf.noise import Noise
from slamreplay.estimators.ekf.observations import base_by
from slamreplay.estimators.ekf.passing import Evidence, Filtered, Held
from slamreplay.estimators.start import Start
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S

#: The robot places itself by the sightings of this time, at most so many of them, and tries it no
#: more often than that.
WINDOW_NS, WINDOW_MOST, RETRY_NS = 10 * NS_PER_S, 16, NS_PER_S
#: Lost: at least so many sightings in a row, over at least this time, were all rejected.
LOST_LEAST, LOST_NS = 5, 10 * NS_PER_S
#: Things whose lasting errors are followed at a time.
SLOTS = 8


#: Wheels' share of turns and gyroscope's bias (2,), with their covariance (2, 2).
_Turns = tuple[se2.Array, se2.Array]

_NEVER = np.iinfo(np.int64).min


@dataclass(frozen=True, eq=False)
class _Events:
    """E moments in order of time, each a measurement or a row (the other index is -1).

    Of measurements the sightings come first, then the fixes.

    `turns` and `turn_variance` (E,) are the gyroscope's from the event before, NaN without it.
    """

    t_ns: NDArray[np.int64]
    steps: Steps
    turns: se2.Array
    turn_variance: se2.Array
    measured: NDArray[np.int64]
    row: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.t_ns)


@dataclass(eq=False)
class _State:
    """Pose, lasting errors and bias, whose errors these are, and `lost` as the kernel keeps it."""

    x: se2.Array
    P: se2.Array
    holder: NDArray[np.int64]
    seen: NDArray[np.int64]
    lost: NDArray[np.int64] = field(default_factory=lambda: np.zeros(3, dtype=np.int64))

    @classmethod
    def at(
        cls, pose: se2.Array, cov: se2.Array, lasting: se2.Array, turns: _Turns | None
    ) -> _State:
        """At a pose, with nothing known of lasting errors, and what is known of turns."""
        slots = SLOTS if lasting.any() else 0
        n = 3 + 2 * slots + 2 * (turns is not None)
        x, P = np.zeros(n), np.zeros((n, n))
        x[:3], P[:3, :3] = pose, cov
        errors = np.arange(3, 3 + 2 * slots)
        P[errors, errors] = np.tile(lasting, slots)
        if turns is not None:
            x[-2:], P[-2:, -2:] = turns
        nobody = np.full(slots, -1, dtype=np.int64)
        return cls(x, P, nobody, nobody.copy())


def gates_of(probability: float) -> se2.Array:
    """(4,) largest NIS of a sighting that is taken in, by its dimension.

    Args:
        probability: with which a sighting that the model describes is taken in.

    Raises:
        UsageError: no probability above 0.
    """
    if not 0.0 < probability <= 1.0:
        raise UsageError(f"gate_probability is {probability}", where="ekf", hint="0 to 1")
    return np.array([0.0, *(float(chdtri(m, 1.0 - probability)) for m in (1, 2, 3))])


def filtered(
    evidence: Evidence,
    noise: Noise,
    gates: se2.Array,
    process_scale: float = 1.0,
    measurement_scale: float = 1.0,
    motion: Motion | None = None,
) -> Filtered:
    """One pass over the log.

    Args:
        evidence: what there is.
        noise: the settings.
        gates: (4,) see `gates_of`.
        process_scale: ratio by which the covariance of motion is multiplied.
        measurement_scale: ratio for that of sightings and fixes, lasting errors and the sensor's
            mount included.
        motion: of this odometry without these constant errors, where it is at hand.
    """
    motion = Motion(evidence.odometry, noise) if motion is None else motion
    this = _Pass(evidence, motion, noise, gates, process_scale, measurement_scale)
    events = this.events
    given = _starts_by_event(evidence, events)
    state: _State | None = None
    event = min(given, default=len(events))
    while event < len(events):
        start = given.pop(event, None)
        end = min(given, default=len(events))
        if start is not None:
            state = this.started(start)
        if state is None:
            event, state = this.search(event, end)
        else:
            event = this.follow(state, event, end, starts=start is not None)
            this.remember(state)
            if event < end:
                state = this.recovered(event - 1) or state
    return this.out()


class _Pass:
    """The arrays that one pass reads and fills in, and the steps it consists of."""

    def __init__(
        self,
        evidence: Evidence,
        motion: Motion,
        noise: Noise,
        gates: se2.Array,
        process_scale: float,
        measurement_scale: float,
    ) -> None:
        seen, N = evidence.observations, len(evidence.row_ns)
        self.evidence, self.motion, self.noise, self.gates = evidence, motion, noise, gates
        self.events, self.silent = _events(evidence, motion, noise, process_scale)
        self.process_scale = process_scale
        measured = self.events.measured
        self.is_sighting = (measured >= 0) & (measured < len(seen))
        fixes, M = evidence.fixes, len(seen)
        F = 0 if fixes is None else len(fixes)
        self.sensed, self.R = np.zeros((M + F, 3)), np.zeros((M + F, 3, 3))
        self.is_near = np.append(seen.is_near, np.zeros(F, dtype=bool))
        self.seen_R = measurement_scale * seen.covariance(noise)
        self.seen = seen.corrected(noise)
        self.sensed[:M], self.R[:M] = self.seen, self.seen_R
        near = np.flatnonzero(seen.is_near)
        self.sensed[near], self.R[near] = seen.in_base(self.seen[near], self.seen_R[near])
        whole = near[seen.dims[near] == 3]
        at = seen.places[seen.thing[whole]]
        self.sensed[whole], self.R[whole] = base_by(self.sensed[whole], self.R[whole], at)
        self.dims = np.append(seen.dims, np.full(F, 2))
        self.thing = np.append(seen.thing, np.full(F, -1))
        t_ns, self.antenna = seen.t_ns, np.zeros(2)
        if fixes is not None:
            self.sensed[M:, :2], self.R[M:, :2, :2] = fixes.xy, measurement_scale * fixes.cov
            t_ns, self.antenna = np.append(t_ns, fixes.t_ns), fixes.antenna_xy
        self.held = Held.none(t_ns, 3)
        lasting = np.array([noise.lasting_range_per_m, noise.lasting_bearing_rad]) ** 2
        self.lasting = measurement_scale * lasting
        self.xyyaw, self.cov = np.full((N, 3), np.nan), np.full((N, 3, 3), np.nan)
        self.updated = np.full(N, np.nan)
        self.turned = Held.none(self.events.t_ns, 1)
        self.turn_out = np.full((len(self.events), 2), np.nan)
        at_first = np.zeros(2), np.diag([noise.wheel_turn, noise.gyro_bias]) ** 2
        self.turns: _Turns | None = None if evidence.gyro is None else at_first
        mount = np.diag([noise.mount_m, noise.mount_m, noise.mount_rad]) ** 2
        self.mount = measurement_scale * mount
        self.retry_ns, self.located, self.recoveries = _NEVER, 0, 0

    def started(self, start: Start) -> _State | None:
        """The state at a pose that was given; None where the filter is to find its own."""
        self.retry_ns = _NEVER
        if start.xyyaw is None:
            return None
        return _State.at(start.xyyaw, start.cov, self.lasting, self.turns)

    def remember(self, state: _State) -> None:
        """Keep what was found of turns: a robot that is lost still has the same wheels and unit."""
        if self.turns is not None:
            self.turns = state.x[-2:].copy(), state.P[-2:, -2:].copy()

    def search(self, first: int, end: int) -> tuple[int, _State | None]:
        """The state at the first event from which sightings tell it, and the event after that."""
        for event in (first + np.flatnonzero(self.is_sighting[first:end])).tolist():
            if self.events.t_ns[event] >= self.retry_ns:
                state = self._located(event)
                if state is not None:
                    return event + 1, state
        return end, None

    def recovered(self, event: int) -> _State | None:
        """The state at an event, by the sightings up to there; None where they tell none."""
        state = self._located(event)
        self.recoveries += state is not None
        return state

    def follow(self, state: _State, first: int, end: int, *, starts: bool) -> int:
        """Run the filter from an event on; returns where it stopped: `end`, or behind a loss."""
        events, seen, held = self.events, self.evidence.observations, self.held
        return int(
            kernels.run(
                first, end, starts, events.t_ns, events.steps.xyyaw, events.steps.Q,
                events.turns, events.turn_variance, events.measured, events.row, self.sensed,
                self.R, self.dims, self.thing, seen.places, self.is_near, self.antenna,
                self.gates, self.lasting, self.noise.lasting_s,
                self.noise.gyro_bias_per_root_s**2, np.array([LOST_LEAST, LOST_NS]),
                self.retry_ns, state.x, state.P, state.holder, state.seen, state.lost,
                self.xyyaw, self.cov, self.updated, held.residual, held.S, held.status,
                held.moved, self.turn_out, self.turned.status, self.turned.moved,
            )
        )  # fmt: skip

    def out(self) -> Filtered:
        """What has been filled in."""
        turned = self.turned
        residual, S = self.turn_out[:, :1], self.turn_out[:, 1:, None]
        turned = Held(turned.t_ns, residual, S, turned.status, turned.moved)
        M, all_ = len(self.evidence.observations), len(self.held.t_ns)
        return Filtered(
            self.xyyaw, self.cov + self.mount, self.updated, self.held.part(0, M, 3),
            self.held.part(M, all_, 2), turned,
            np.full(2, np.nan) if self.turns is None else self.turns[0], self.located,
            self.recoveries,
            self.silent,
        )  # fmt: skip

    def _located(self, event: int) -> _State | None:
        """The state at an event by the sightings of the window that ends there."""
        events, seen = self.events, self.evidence.observations
        self.retry_ns = int(events.t_ns[event]) + RETRY_NS
        first = np.searchsorted(events.t_ns, events.t_ns[event] - WINDOW_NS)
        window = first + np.flatnonzero(self.is_sighting[first : event + 1])
        window = window[-WINDOW_MOST:]
        rows = events.measured[window]
        if len(rows) < LEAST_AGREEING:
            return None
        steps = self.motion.steps(events.t_ns[window], self.noise)
        thing, far = seen.thing[rows], ~self.is_near[rows]
        sensed, R = self.seen[rows], self.seen_R[rows]
        # Settings that are too sure of themselves must not keep a robot from finding its start.
        R[far] = np.maximum(R[far], seen.covariance(Noise())[rows[far]])
        # A lasting error is one and the same in all sightings of a thing: they share its weight.
        times = far * (thing[:, None] == thing[None, :]).sum(axis=1)
        R[:, 0, 0] += times * self.lasting[0] * sensed[:, 0] ** 2
        R[:, 1, 1] += times * self.lasting[1]
        points, R = seen.in_base(sensed, R)
        found = locate(
            window_of(
                points, seen.dims[rows], R, seen.places[thing], thing, steps.xyyaw,
                self.process_scale * steps.Q,
            )
        )  # fmt: skip
        if found is None:
            return None
        state = _State.at(*found, self.lasting, self.turns)
        state.lost[2] = 1
        self.located += 1
        return state


def _events(
    evidence: Evidence, motion: Motion, noise: Noise, process_scale: float
) -> tuple[_Events, int]:
    """Events at which odometry is known, and how many sightings and fixes came at other times."""
    fixed_ns = evidence.row_ns[:0] if evidence.fixes is None else evidence.fixes.t_ns
    M, F = len(evidence.observations), len(fixed_ns)
    t_ns = np.concatenate([evidence.observations.t_ns, fixed_ns, evidence.row_ns])
    known = motion.known(t_ns, noise)
    order = np.argsort(t_ns, kind="stable")  # at equal times sightings come before rows
    order = order[known[order]]
    at_ns = t_ns[order]
    steps = motion.steps(at_ns, noise)
    turns, turn_variance = np.full(len(order), np.nan), np.full(len(order), np.nan)
    if evidence.gyro is not None:
        turns, turn_variance = evidence.gyro.between(at_ns, noise)
    events = _Events(
        at_ns,
        Steps(steps.xyyaw, process_scale * steps.Q),
        turns,
        process_scale * turn_variance,
        np.where(order < M + F, order, -1),
        np.where(order >= M + F, order - M - F, -1),
    )
    return events, int((~known[: M + F]).sum())


def _starts_by_event(evidence: Evidence, events: _Events) -> dict[int, Start]:
    """Each start at the first event at or after its time; one after the last event is none."""
    at = np.searchsorted(events.t_ns, [evidence.row_ns[start.row] for start in evidence.given])
    return {
        int(event): start
        for event, start in zip(at, evidence.given, strict=True)
        if event < len(events)
    }
