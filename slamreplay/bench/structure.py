"""A place as it stands today: things put down, taken away, moved; never on the robot's way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slamreplay.geometry import se2
from slamreplay.simulate.halls import bounds_of, fits
from slamreplay.simulate.worlds import Solid, World, box

#: What is put down or moved keeps this far from the driven way, m.
_OFF_THE_WAY_M = 0.6
_TRIES = 40


def boxes_added(world: World, way: se2.Array, rng: np.random.Generator) -> World:
    """Pallets and boxes beside the way: 6 to 14 of them."""
    return _with_boxes(world, way, rng, int(rng.integers(6, 15)))


def racks_removed(world: World, way: se2.Array, rng: np.random.Generator) -> World:
    """One to four of the racks next to the way are gone."""
    near = _by_distance(world, way)[: int(rng.integers(2, 6))]
    kept = max(1, int(rng.integers(1, 5)))
    return world.changed(without=[s.name for s in rng.permutation(np.array(near, object))[:kept]])


def racks_moved(world: World, way: se2.Array, rng: np.random.Generator) -> World:
    """Two to four of the racks next to the way stand 0.6 to 2 m elsewhere."""
    return _with_moved(world, _by_distance(world, way)[: int(rng.integers(2, 5))], way, rng)


def half_changed(world: World, way: se2.Array, rng: np.random.Generator) -> World:
    """Half of what is no wall is gone or elsewhere, and boxes stand about."""
    movable = np.array(_by_distance(world, way), dtype=object)
    chosen = list(rng.permutation(movable)[: (len(movable) + 1) // 2])
    cut = int(rng.integers(len(chosen) + 1))
    world = world.changed(without=[s.name for s in chosen[:cut]])
    world = _with_moved(world, chosen[cut:], way, rng)
    return _with_boxes(world, way, rng, int(rng.integers(3, 9)))


def changed_solids(mapped: World, standing: World) -> tuple[list[Solid], list[Solid]]:
    """What stands and is not mapped, and what is mapped and is gone."""
    then, now = set(mapped.solids), set(standing.solids)
    return (
        [s for s in standing.solids if s not in then],
        [s for s in mapped.solids if s not in now],
    )


def _movable(solid: Solid) -> bool:
    return solid.name.startswith(("rack", "furniture"))


def _by_distance(world: World, way: se2.Array) -> list[Solid]:
    """What can be moved, the nearest to the way first."""
    found = [s for s in world.solids if _movable(s)]
    return sorted(found, key=lambda s: (round(_apart(s, way), 3), s.name))


def _apart(solid: Solid, way: se2.Array) -> float:
    """Distance between the way and the solid's bounding box."""
    x0, y0, x1, y1 = bounds_of(solid)
    dx = np.maximum(np.maximum(x0 - way[:, 0], way[:, 0] - x1), 0.0)
    dy = np.maximum(np.maximum(y0 - way[:, 1], way[:, 1] - y1), 0.0)
    return float(np.hypot(dx, dy).min())


def _with_boxes(world: World, way: se2.Array, rng: np.random.Generator, n: int) -> World:
    size = (world.bounds[2], world.bounds[3])
    taken = [bounds_of(s) for s in world.solids]
    added: list[Solid] = []
    for i in range(n):
        for _ in range(_TRIES):
            at = way[rng.integers(len(way))]
            far, towards = rng.uniform(1.2, 3.0), rng.uniform(-np.pi, np.pi)
            x, y = at + far * np.array([np.cos(towards), np.sin(towards)])
            wide, deep = rng.uniform(0.6, 1.6), rng.uniform(0.6, 1.2)
            turn = rng.uniform(-0.3, 0.3)
            solid = box(f"pallet {i}", x - wide / 2, y - deep / 2, wide, deep, turn)
            if fits(solid, taken, size, 0.05) and _apart(solid, way) > _OFF_THE_WAY_M:
                added.append(solid)
                taken.append(bounds_of(solid))
                break
    return world.changed(added=added)


def _with_moved(
    world: World, chosen: list[Solid], way: se2.Array, rng: np.random.Generator
) -> World:
    size = (world.bounds[2], world.bounds[3])
    for solid in chosen:
        rest = [bounds_of(s) for s in world.solids if s is not solid]
        for _ in range(_TRIES):
            far, towards = rng.uniform(0.6, 2.0), rng.uniform(-np.pi, np.pi)
            step = far * np.array([np.cos(towards), np.sin(towards)])
            corners = tuple((float(x + step[0]), float(y + step[1])) for x, y in solid.corners)
            there = replace(solid, name=f"{solid.name} moved", corners=corners)
            if fits(there, rest, size, 0.05) and _apart(there, way) > _OFF_THE_WAY_M:
                world = world.changed(without=(solid.name,), added=(there,))
                break
    return world
