"""How the robot really moves: a differential drive that follows waypoints, stops, turns, backs up.

The tour is given as steps in the true world. What the robot believes meanwhile is the localizer's
business: the same tour is driven whether it knows where it is or not, so that what a fault does to
the belief can be seen alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2

RATE_HZ = 50
_DT = 1.0 / RATE_HZ
_ACCEL, _BRAKE, _TURN_ACCEL = 0.6, 0.8, 2.0  # m/s^2, m/s^2, rad/s^2
_TURN_RATE = 0.8  # rad/s
_LOOKAHEAD_M = 0.7
_ARRIVED_M = 0.01


@dataclass(frozen=True)
class Slip:
    """Wheels that lose grip within a stretch of a path.

    Attributes:
        from_m: arc length of the path at which it begins.
        duration_s: how long it lasts.
        grip: share of the wheels' speed that moves the robot.
        yaw_rate: rad/s by which the robot turns while its wheels do not say so.
    """

    from_m: float
    duration_s: float
    grip: float
    yaw_rate: float = 0.0


@dataclass(frozen=True)
class Follow:
    """Drive along waypoints in the map frame.

    Attributes:
        waypoints: the corners, m; the path starts where the robot stands.
        speed: m/s on straights.
        beyond: waypoints that are planned but not reached, for the way is blocked.
        slip: where the wheels lose grip.
    """

    waypoints: tuple[tuple[float, float], ...]
    speed: float = 0.8
    beyond: tuple[tuple[float, float], ...] = ()
    slip: Slip | None = None


@dataclass(frozen=True)
class Pause:
    """Stand still; `name` is the behaviour that does so (Wait), empty when nothing is wrong."""

    duration_s: float
    name: str = ""


@dataclass(frozen=True)
class Spin:
    """Turn on the spot by `angle` rad."""

    angle: float
    name: str = "Spin"


@dataclass(frozen=True)
class BackUp:
    """Drive straight back."""

    distance_m: float = 0.3
    speed: float = 0.12
    name: str = "BackUp"


@dataclass(frozen=True)
class Carry:
    """Somebody moves the robot by hand to (x, y, yaw).

    Attributes:
        to_xyyaw: where it ends up.
        duration_s: how long that takes.
        wheels: share of the motion that its wheels turn with; 0 when it is lifted.
    """

    to_xyyaw: tuple[float, float, float]
    duration_s: float = 4.0
    wheels: float = 0.0


Step = Follow | Pause | Spin | BackUp | Carry


@dataclass(frozen=True)
class Phase:
    """One step of the tour and the samples [first, last) of the motion that belong to it."""

    step: Step
    first: int
    last: int
    path: NDArray[np.float64]  # (N, 2) what was to be followed, true world; empty for other steps


@dataclass(frozen=True, eq=False)
class Motion:
    """Samples at `RATE_HZ`.

    Attributes:
        t_s: (N,) time since the start.
        xyyaw: (N, 3) true base poses in the map frame.
        twist: (N, 2) true speed m/s and turn rate rad/s.
        wheels: (N, 2) the same as the wheels would have it; differs in a slip and when carried.
        phases: the steps in order.
    """

    t_s: se2.Array
    xyyaw: se2.Array
    twist: se2.Array
    wheels: se2.Array
    phases: tuple[Phase, ...]

    def poses_at(self, t_s: se2.Array) -> se2.Array:
        """(M, 3) poses between the samples."""
        ns = (self.t_s * 1e9).astype(np.int64)
        return se2.interpolate(ns, self.xyyaw, np.rint(t_s * 1e9).astype(np.int64))


@dataclass
class _Robot:
    pose: se2.Array
    v: float = 0.0
    w: float = 0.0
    poses: list[se2.Array] = field(default_factory=list)
    twists: list[tuple[float, float]] = field(default_factory=list)
    wheels: list[tuple[float, float]] = field(default_factory=list)

    def tick(self, v_goal: float, w_goal: float, *, grip: float = 1.0, drift: float = 0.0) -> None:
        """One step towards the wanted speeds, within what the motors can do."""
        rise = _ACCEL if abs(v_goal) > abs(self.v) else _BRAKE
        self.v += float(np.clip(v_goal - self.v, -rise * _DT, rise * _DT))
        self.w += float(np.clip(w_goal - self.w, -_TURN_ACCEL * _DT, _TURN_ACCEL * _DT))
        v, w = self.v * grip, self.w * grip + drift
        self._record(v, w, self.v, self.w)
        self.pose = se2.compose(
            self.pose, [v * _DT * np.cos(w * _DT / 2), v * _DT * np.sin(w * _DT / 2), w * _DT]
        )

    def _record(self, v: float, w: float, wheel_v: float, wheel_w: float) -> None:
        self.poses.append(self.pose)
        self.twists.append((v, w))
        self.wheels.append((wheel_v, wheel_w))

    def stop(self) -> None:
        while abs(self.v) > 1e-9 or abs(self.w) > 1e-9:
            self.tick(0.0, 0.0)

    def put(self, pose: se2.Array, wheels: float) -> None:
        """Be somewhere else; the wheels turn with that share of the motion."""
        step = se2.between(self.pose, pose)
        v, w = float(step[0]) / _DT, float(step[2]) / _DT
        self._record(v, w, wheels * v, wheels * w)
        self.pose = pose


def drive(start_xyyaw: tuple[float, float, float], tour: tuple[Step, ...]) -> Motion:
    """The motion through all steps of a tour, one after the other."""
    robot = _Robot(np.array(start_xyyaw, dtype=np.float64))
    phases = []
    for step in tour:
        first, path = len(robot.poses), np.empty((0, 2))
        match step:
            case Follow():
                path = np.vstack([robot.pose[:2], *step.waypoints])
                _follow(robot, path, step)
            case Pause():
                for _ in range(round(step.duration_s * RATE_HZ)):
                    robot.tick(0.0, 0.0)
            case Spin():
                _turn(robot, step.angle)
            case BackUp():
                _back_up(robot, step)
            case Carry():
                _carry(robot, step)
        phases.append(Phase(step, first, len(robot.poses), path))
    n = len(robot.poses)
    return Motion(
        np.arange(n) / RATE_HZ,
        np.array(robot.poses),
        np.array(robot.twists),
        np.array(robot.wheels),
        tuple(phases),
    )


def _follow(robot: _Robot, path: se2.Array, step: Follow) -> None:
    """Pure pursuit (Coulter, 1992): steer for the point a lookahead further along the path."""
    lengths = np.hypot(*np.diff(path, axis=0).T)
    arcs = np.concatenate([[0.0], np.cumsum(lengths)])
    done, slipping = 0.0, 0
    heading = np.arctan2(*(path[1] - path[0])[::-1])
    if abs(se2.wrap_angle(heading - robot.pose[2])) > 0.6:
        _turn(robot, float(se2.wrap_angle(heading - robot.pose[2])))
    while arcs[-1] - done > _ARRIVED_M:
        done = _progress(path, arcs, robot.pose[:2], done)
        left = arcs[-1] - done
        ahead = min(done + _LOOKAHEAD_M, arcs[-1])
        target = np.array([np.interp(ahead, arcs, path[:, i]) for i in (0, 1)])
        x, y = se2.transform_points(se2.inverse(robot.pose), target[None])[0]
        curvature = 2.0 * y / max(x * x + y * y, 0.04)
        v = min(step.speed, np.sqrt(2.0 * 0.8 * _BRAKE * max(left, 0.0)) + 0.02)
        v = min(v, _TURN_RATE / max(abs(curvature), 1e-6))
        v = v if left > 0.15 or x > 0.0 else 0.0
        grip, drift = 1.0, 0.0
        slip = step.slip
        if slip and done >= slip.from_m and slipping < slip.duration_s * RATE_HZ:
            grip, drift = slip.grip, slip.yaw_rate
            slipping += 1
        robot.tick(v, v * curvature if left > 0.1 else 0.0, grip=grip, drift=drift)
        if v == 0.0 and robot.v == 0.0:
            break
    robot.stop()


def _progress(path: se2.Array, arcs: se2.Array, at: se2.Array, done: float) -> float:
    """Arc length of the nearest point of the path, looked for a little ahead only."""
    sample = np.linspace(done, min(done + 0.5, arcs[-1]), 51)
    xs, ys = np.interp(sample, arcs, path[:, 0]), np.interp(sample, arcs, path[:, 1])
    return float(sample[np.argmin(np.hypot(xs - at[0], ys - at[1]))])


def _turn(robot: _Robot, angle: float) -> None:
    left = angle
    while abs(left) > 0.004:
        w = np.sign(left) * min(_TURN_RATE, np.sqrt(1.6 * _TURN_ACCEL * abs(left)) * 0.8)
        robot.tick(0.0, float(w))
        left -= robot.w * _DT
    robot.stop()


def _back_up(robot: _Robot, step: BackUp) -> None:
    left = step.distance_m
    while left > robot.v**2 / (2 * _BRAKE):
        robot.tick(-step.speed, 0.0)
        left += robot.v * _DT
    robot.stop()


def _carry(robot: _Robot, step: Carry) -> None:
    n = round(step.duration_s * RATE_HZ)
    start, goal = robot.pose, np.array(step.to_xyyaw, dtype=np.float64)
    turn = float(se2.wrap_angle(goal[2] - start[2]))
    for i in range(1, n + 1):
        part = 0.5 - 0.5 * np.cos(np.pi * i / n)
        xy = start[:2] + part * (goal[:2] - start[:2])
        robot.put(np.array([*xy, start[2] + part * turn]), step.wheels)
