"""Random office floors: a corridor, rooms with doors on both sides, furniture; from a seed."""

from __future__ import annotations

import numpy as np

from slamreplay.simulate.halls import bounds_of, fits, transposed
from slamreplay.simulate.worlds import Solid, World, box, room_walls

_INNER_WALL_M = 0.15
_DOOR_M = (1.5, 1.9)


def random_office(rng: np.random.Generator) -> World:
    """A floor of 18 to 38 m by 12 to 19 m."""
    width, corridor = rng.uniform(18.0, 38.0), rng.uniform(2.0, 2.8)
    south, north = rng.uniform(4.6, 7.5, size=2)
    height = south + corridor + north
    solids: list[Solid] = []
    for side, (low, high) in (("south", (0.0, south)), ("north", (south + corridor, height))):
        wall_y = high - _INNER_WALL_M if side == "south" else low
        x, room = 0.0, 0
        while x < width - 1.0:
            end = x + rng.uniform(3.6, 7.5)
            end = width if width - end < 3.6 else end
            wide = rng.uniform(*_DOOR_M)
            door = rng.uniform(x + 0.4, end - 0.4 - wide)
            name = f"{side} {room}"
            pieces = ((x, door), (door + wide, end))
            solids += [
                box(f"inner {name} {i}", a, wall_y, b - a, _INNER_WALL_M)
                for i, (a, b) in enumerate(pieces)
            ]
            if end < width:
                depth = high - low
                solids.append(box(f"cross {name}", end, low, _INNER_WALL_M, depth))
            solids += _furniture(rng, name, (x + 0.15, low, end, high), (door, door + wide), wall_y)
            x, room = end, room + 1
    for i in range(int(width / 3.0)):  # what stands along the walls of a corridor
        at, wide, deep = rng.uniform(0.5, width - 2.0), rng.uniform(0.3, 1.2), rng.uniform(0.2, 0.4)
        y = south if rng.random() < 0.5 else south + corridor - deep
        piece = box(f"furniture corridor {i}", at, y, wide, deep)
        doors = [bounds_of(s) for s in solids if s.name.startswith("furniture corridor")]
        if not _in_a_door(piece, solids, south, corridor) and fits(
            piece, doors, (width, height), 1.2
        ):
            solids.append(piece)
    bounds = (0.0, 0.0, float(width), float(height))
    world = World(bounds, (*room_walls("wall", bounds), *solids))
    return transposed(world) if rng.random() < 0.5 else world


def _furniture(
    rng: np.random.Generator,
    name: str,
    room: tuple[float, float, float, float],
    door: tuple[float, float],
    wall_y: float,
) -> list[Solid]:
    x0, y0, x1, y1 = room
    # Nobody puts a table into a doorway.
    taken = [(door[0], wall_y - 0.6, door[1], wall_y + 0.6)]
    found: list[Solid] = []
    for i in range(int(rng.integers(2, 6))):
        wide, deep = rng.uniform(0.5, 1.7), rng.uniform(0.4, 0.9)
        if rng.random() < 0.5:
            wide, deep = deep, wide
        x, y = rng.uniform(x0 + 0.1, x1 - wide - 0.1), rng.uniform(y0 + 0.1, y1 - deep - 0.1)
        turn = rng.uniform(-0.4, 0.4) if rng.random() < 0.4 else 0.0
        piece = box(f"furniture {name} {i}", x, y, wide, deep, turn)
        a, b, c, d = bounds_of(piece)
        inside = a > x0 and c < x1 and b > y0 + 0.05 and d < y1 - 0.05
        if inside and fits(piece, taken, (1e9, 1e9), 0.7):
            taken.append(bounds_of(piece))
            found.append(piece)
    return found


def _in_a_door(piece: Solid, solids: list[Solid], south: float, corridor: float) -> bool:
    """Whether a piece of corridor furniture stands before an opening of the wall behind it."""
    x0, y0, x1, _ = bounds_of(piece)
    side = "inner south" if y0 < south + corridor / 2.0 else "inner north"
    walls = [bounds_of(s) for s in solids if s.name.startswith(side)]
    return not any(a <= x0 - 0.3 and c >= x1 + 0.3 for a, _, c, _ in walls)
