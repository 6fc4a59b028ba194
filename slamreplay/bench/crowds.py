"""People and moving pallets, who get out of the robot's way."""

from __future__ import annotations

import numpy as np

from slamreplay.simulate.drive import Motion
from slamreplay.simulate.people import Walker
from slamreplay.simulate.routes import Floor

#: Nobody comes nearer to the robot's middle than this.
_POLITE_M = 0.6
_TRIES = 12


def crowd(floor: Floor, motion: Motion, n: int, rng: np.random.Generator) -> tuple[Walker, ...]:
    """Up to `n` walkers on straight ways through free space; one in five pushes a pallet."""
    t_s = motion.t_s[::10]
    robot = motion.xyyaw[::10, :2]
    found: list[Walker] = []
    for _ in range(n):
        radius = 0.4 if rng.random() < 0.2 else 0.22
        for _ in range(_TRIES):
            a = np.array(floor.random_place(rng))
            if len(found) % 2:  # every other one walks where the robot is
                near = robot[rng.integers(len(robot))]
                a = a if np.hypot(*(a - near)) < 6.0 else near + rng.uniform(-2.5, 2.5, size=2)
            turn, far = rng.uniform(-np.pi, np.pi), rng.uniform(3.0, 12.0)
            b = a + far * np.array([np.cos(turn), np.sin(turn)])
            walker = Walker(
                ((float(a[0]), float(a[1])), (float(b[0]), float(b[1]))),
                float(rng.uniform(0.7, 1.5)),
                float(rng.uniform(0.0, 2.0 * far)),
                radius,
            )
            apart = np.hypot(*(walker.at(t_s) - robot).T).min() - radius
            if floor.sees(a, b) and apart > _POLITE_M - 0.22:
                found.append(walker)
                break
    return tuple(found)
