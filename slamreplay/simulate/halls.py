"""Random warehouses: rows of racks, cross aisles, pillars and what stands about, from a seed."""

from __future__ import annotations

import numpy as np

from slamreplay.simulate.worlds import Solid, World, box, disc, room_walls

#: Room for a robot beside what is put down at random, m.
CLEAR_M = 1.0


def random_warehouse(rng: np.random.Generator, size_m: tuple[float, float] | None = None) -> World:
    """A hall of 16 to 40 m by 14 to 28 m whose racks all differ in length.

    Args:
        rng: of every choice.
        size_m: width and height where the hall is to be another.
    """
    width, height = size_m or (rng.uniform(18.0, 40.0), rng.uniform(15.0, 28.0))
    open_part = rng.uniform(0.15, 0.3) * width
    solids: list[Solid] = []
    y, row = rng.uniform(1.9, 2.8), 0
    while y + 1.2 + 1.9 < height:
        depth = rng.uniform(0.8, 1.2)
        x, k = rng.uniform(1.9, 3.6), 0
        while x + 2.0 < width - open_part:
            length = min(rng.uniform(2.0, 6.5), width - open_part - x)
            shift = rng.uniform(0.0, 0.15)
            solids.append(box(f"rack {row}.{k}", x, y + shift, length, depth))
            x += length + (rng.uniform(1.8, 2.8) if rng.random() < 0.6 else rng.uniform(0.05, 0.3))
            k += 1
        y += depth + rng.uniform(2.0, 3.2)
        row += 1
    solids += _stuff(rng, (width, height), tuple(solids), width - open_part)
    return _finished(rng, (width, height), solids, turned=rng.random() < 0.5)


def repeated_aisles(rng: np.random.Generator, shorter: int = 2) -> tuple[World, float]:
    """A hall of racks that repeat at one pitch, told apart by little; and the pitch along y, m.

    Some racks are short, and buttresses and pillars stand at uneven places: one aisle looks much
    like the next one, but not quite. Without short racks only the hall's ends tell them apart.

    Args:
        rng: of every choice.
        shorter: how many racks are short.
    """
    rows = int(rng.integers(4, 6))
    pitch = float(rng.uniform(3.2, 3.9))
    lengths = rng.uniform(4.0, 6.0, size=int(rng.integers(2, 4)))
    gap, x0, y0 = rng.uniform(2.0, 2.6), rng.uniform(2.4, 3.0), rng.uniform(2.6, 3.2)
    width = x0 + lengths.sum() + gap * (len(lengths) - 1) + rng.uniform(2.4, 3.2)
    height = y0 + pitch * (rows - 1) + 1.0 + rng.uniform(2.2, 2.8)
    odd = {int(k) for k in rng.choice(rows * len(lengths), size=shorter, replace=False)}
    solids = []
    for row in range(rows):
        x = x0
        for k, length in enumerate(lengths):
            less = rng.uniform(0.8, 1.6) if row * len(lengths) + k in odd else 0.0
            solids.append(box(f"rack {row}.{k}", x, y0 + row * pitch, length - less, 1.0))
            x += length + gap
    return _finished(rng, (width, height), solids, turned=False), pitch


def _stuff(
    rng: np.random.Generator, size: tuple[float, float], racks: tuple[Solid, ...], open_from: float
) -> list[Solid]:
    """Pillars and furniture that leave the robot room to pass."""
    taken = [bounds_of(s) for s in racks]
    found: list[Solid] = []
    area = size[0] * size[1]
    for i in range(int(area / 60.0 * rng.uniform(0.7, 1.3))):
        in_open = rng.random() < 0.6
        x = rng.uniform(open_from, size[0] - 1.2) if in_open else rng.uniform(1.2, size[0] - 1.2)
        y = rng.uniform(1.2, size[1] - 1.2)
        kind = rng.random()
        if kind < 0.35:
            solid = disc(f"pillar {i}", x, y, rng.uniform(0.15, 0.3))
        elif kind < 0.6:
            edge = rng.uniform(0.3, 0.5)
            solid = box(f"pillar {i}", x, y, edge, edge)
        else:
            turn = rng.uniform(-0.5, 0.5)
            solid = box(f"furniture {i}", x, y, rng.uniform(0.8, 2.2), rng.uniform(0.6, 1.3), turn)
        if fits(solid, taken, size, CLEAR_M + 0.3):
            taken.append(bounds_of(solid))
            found.append(solid)
    return found


def _finished(
    rng: np.random.Generator, size: tuple[float, float], solids: list[Solid], *, turned: bool
) -> World:
    """Walls with buttresses at uneven distances; a turned hall has its racks along y."""
    width, height = size
    parts = list(solids)
    for name, length in (("south", width), ("north", width), ("west", height), ("east", height)):
        at, k = rng.uniform(0.5, 3.0), 0
        while at + 1.0 < length:
            wide, deep = rng.uniform(0.25, 0.9), rng.uniform(0.2, 0.4)
            corner = {
                "south": (at, 0.0, wide, deep),
                "north": (at, height - deep, wide, deep),
                "west": (0.0, at, deep, wide),
                "east": (width - deep, at, deep, wide),
            }[name]
            parts.append(box(f"buttress {name} {k}", *corner))
            at += rng.uniform(2.0, 6.0)
            k += 1
    bounds = (0.0, 0.0, float(width), float(height))
    world = World(bounds, (*room_walls("wall", bounds), *parts))
    return transposed(world) if turned else world


def transposed(world: World) -> World:
    """The same place with x and y exchanged; outlines stay anticlockwise."""
    x0, y0, x1, y1 = world.bounds
    solids = tuple(
        Solid(s.name, tuple((y, x) for x, y in reversed(s.corners))) for s in world.solids
    )
    return World((y0, x0, y1, x1), solids)


def bounds_of(solid: Solid) -> tuple[float, float, float, float]:
    """x_min, y_min, x_max, y_max of an outline."""
    xs, ys = zip(*solid.corners, strict=True)
    return min(xs), min(ys), max(xs), max(ys)


def fits(
    solid: Solid,
    taken: list[tuple[float, float, float, float]],
    size: tuple[float, float],
    clear_m: float,
) -> bool:
    """Whether a solid stays inside the hall and that far from everything else."""
    x0, y0, x1, y1 = bounds_of(solid)
    if x0 < 0.3 or y0 < 0.3 or x1 > size[0] - 0.3 or y1 > size[1] - 0.3:
        return False
    return all(
        x0 > c + clear_m or x1 < a - clear_m or y0 > d + clear_m or y1 < b - clear_m
        for a, b, c, d in taken
    )
