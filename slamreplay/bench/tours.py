"""The way a robot goes in each kind of incident, and what disturbs its motion or its start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slamreplay.bench.conditions import Place
from slamreplay.simulate.drive import Carry, Follow, Pause, Slip, Step
from slamreplay.simulate.routes import XY, Floor, random_route
from slamreplay.simulate.scenarios import Scenario
from slamreplay.simulate.sensors import WheelErrors


def on_tour(kind: str, place: Place, floor: Floor, rng: np.random.Generator) -> Scenario | None:
    """A tour of a minute or two, and what disturbs it; None where there is no room for that."""
    at = floor.random_place(rng, 0.8)
    length = float(rng.uniform(38.0, 62.0))
    mode = "wrong_start" if kind == "lost_in_changed" and rng.random() < 0.7 else kind
    mode = "wheel_slip" if mode == "lost_in_changed" else mode
    before = random_route(floor, rng, at, length * (rng.uniform(0.25, 0.5)))
    if not before:
        return None
    steps: list[Step] = [Pause(float(rng.uniform(1.0, 3.0)))]
    steps += _legs(before, rng)
    end = before[-1][-1]
    if mode == "wheel_slip":
        steps = _slipping(steps, rng)
    elif mode == "push":
        pushed = _pushed(steps, before[-1], floor, rng)
        if pushed is None:
            return None
        steps, end = pushed
    elif mode == "kidnapped":
        end = _far_from(end, 3.0, floor, rng)
        yaw = float(rng.uniform(-np.pi, np.pi))
        steps += [Carry((*end, yaw), float(rng.uniform(3.0, 8.0))), Pause(float(rng.uniform(1, 3)))]
    steps += _legs(random_route(floor, rng, end, length * 0.6), rng)
    yaw = float(rng.uniform(-np.pi, np.pi))
    world = place.world
    story = Scenario(world, world, (*at, yaw), tuple(steps), "", 0, wheels=_wheels(rng))
    if mode == "wrong_start":
        other = _far_from(at, 1.5, floor, rng)
        turn = rng.uniform(-0.5, 0.5) if rng.random() < 0.5 else rng.uniform(-np.pi, np.pi)
        return replace(story, believed_start=(*other, yaw + float(turn)))
    if kind == "identical_aisles" and place.pitch_m:
        return _one_aisle_off(story, place.pitch_m, floor, rng)
    return story


def _one_aisle_off(
    story: Scenario, pitch_m: float, floor: Floor, rng: np.random.Generator
) -> Scenario | None:
    """The same story, begun in the belief to be one aisle up or down."""
    x, y, yaw = story.start
    side = pitch_m if rng.random() < 0.5 else -pitch_m
    for off in (side, -side):
        if floor.at(np.array([[x, y + off]]))[0] > 0.5:
            return replace(story, believed_start=(x, y + off, yaw))
    return None


def _far_from(place: XY, least_m: float, floor: Floor, rng: np.random.Generator) -> XY:
    """Another place, at least that far away."""
    while True:
        other = floor.random_place(rng, 0.8)
        if np.hypot(other[0] - place[0], other[1] - place[1]) >= least_m:
            return other


def _legs(legs: Sequence[tuple[XY, ...]], rng: np.random.Generator) -> list[Step]:
    steps: list[Step] = []
    for leg in legs:
        steps.append(Follow(leg, speed=float(rng.uniform(0.65, 0.95))))
        steps.append(Pause(float(rng.uniform(0.5, 3.0))))
    return steps


def _wheels(rng: np.random.Generator) -> WheelErrors:
    """Wheels as they are: a percent off, unequal by a millimetre."""
    scale, turn_scale, pull = rng.normal(0.0, (0.006, 0.008, 0.0012))
    return WheelErrors(float(scale), float(turn_scale), float(pull))


def _length(step: Follow, start: XY) -> float:
    points = np.array([start, *step.waypoints])
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def _slipping(steps: list[Step], rng: np.random.Generator) -> list[Step]:
    """The same steps with a slip in the longest leg."""
    legs = [i for i, s in enumerate(steps) if isinstance(s, Follow)]
    lengths = {i: _length(s, s.waypoints[0]) for i in legs if isinstance(s := steps[i], Follow)}
    longest = max(legs, key=lengths.__getitem__)
    leg = steps[longest]
    assert isinstance(leg, Follow)
    slip = Slip(
        from_m=float(rng.uniform(0.5, max(0.6, lengths[longest] - 2.0))),
        duration_s=float(rng.uniform(3.0, 7.0)),
        grip=float(rng.uniform(0.0, 0.2)),
        yaw_rate=float(rng.uniform(-0.15, 0.15)),
    )
    return [*steps[:longest], replace(leg, slip=slip), *steps[longest + 1 :]]


def _pushed(
    steps: list[Step], last: tuple[XY, ...], floor: Floor, rng: np.random.Generator
) -> tuple[list[Step], XY] | None:
    """Steps that end in a push, and where it leaves the robot."""
    end, mode = last[-1], rng.random()
    if mode < 0.3:  # somebody bumps into it while it drives: the heading jumps, the wheels do not
        leg = max(i for i, s in enumerate(steps) if isinstance(s, Follow))
        step = steps[leg]
        assert isinstance(step, Follow)
        kick = float(rng.uniform(1.0, 2.6)) * (1.0 if rng.random() < 0.5 else -1.0)
        slip = Slip(float(rng.uniform(0.5, 3.0)), 1.0, 0.3, kick)
        return [*steps[:leg], replace(step, slip=slip), *steps[leg + 1 :]], end
    wheels = float(rng.uniform(0.2, 0.7)) if rng.random() < 0.5 else 0.0
    before = last[-2] if len(last) > 1 else (end[0] - 1, end[1])
    heading = float(np.arctan2(end[1] - before[1], end[0] - before[0]))
    if mode < 0.65:  # turned on the spot
        kick = float(rng.uniform(1.0, 2.6)) * (1.0 if rng.random() < 0.5 else -1.0)
        to = (*end, heading + kick)
        return [*steps, Carry(to, float(rng.uniform(0.8, 1.6)), wheels), Pause(1.0)], end
    for _ in range(30):  # shoved or carried some metres
        far, towards = rng.uniform(1.0, 4.0), rng.uniform(-np.pi, np.pi)
        there = np.array(end) + far * np.array([np.cos(towards), np.sin(towards)])
        if floor.sees(np.array(end), there):
            spot = (float(there[0]), float(there[1]))
            turn = float(rng.uniform(-0.4, 0.4))
            carry = Carry((*spot, heading + turn), float(far / rng.uniform(0.5, 1.2)), wheels)
            return [*steps, carry, Pause(1.0)], spot
    return None
