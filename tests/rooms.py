"""The synthetic room and what may become of it, for tests of maps that change inside a log."""

import numpy as np

from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.raycast import cast_rays
from slamreplay.testing.edits import rebuilt
from slamreplay.testing.synthetic import (
    MOUNT_XYYAW,
    START_NS,
    room_grid,
    synthetic_bundle,
    true_path,
)

SECOND = 10**9


def at(t_s):
    return START_NS + round(t_s * SECOND)


def with_cells(cells, frame_id="map"):
    return OccupancyGrid(cells, 0.05, room_grid().origin_xyyaw, frame_id)


def boxed():
    """The room with two boxes in it."""
    cells = room_grid().cells.copy()
    cells[60:76, 20:36] = 100
    cells[130:150, 60:80] = 100
    return with_cells(cells)


def upstairs(frame_id="map"):
    """Another floor: the outer walls are the room's, all within them is different."""
    cells = np.zeros((180, 240), dtype=np.int8)
    cells[[0, 1, -2, -1]] = 100
    cells[:, [0, 1, -2, -1]] = 100
    for rows, cols in (
        (slice(82, 96), slice(90, 150)),
        (slice(2, 20), slice(60, 100)),
        (slice(2, 40), slice(2, 12)),
        (slice(165, 178), slice(100, 130)),
        (slice(60, 120), slice(228, 238)),
    ):
        cells[rows, cols] = 100
    return with_cells(cells, frame_id)


def mapped_until(world, t_s):
    """What a mapper knows of the world after a while, cropped to it."""
    lasers = se2.compose(true_path(np.arange(0.0, min(t_s, 40.0), 1.0)), MOUNT_XYYAW)
    bearings = np.linspace(-2.2, 2.2, 300)
    ranges = np.minimum(cast_rays(world, lasers, bearings, 10.0), 10.0) + 0.06
    known = np.zeros(world.cells.shape, dtype=bool)
    for laser, reach in zip(lasers, ranges, strict=True):
        along = np.arange(0.0, 10.0, 0.04)
        x, y = (np.multiply.outer(along, f(bearings)) for f in (np.cos, np.sin))
        ends = np.stack([x, y], axis=-1)[along[:, None] <= reach]
        cell = world.cell_of(se2.transform_points(laser, ends))
        cell = cell[world.inside(cell)]
        known[cell[:, 0], cell[:, 1]] = True
    rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    part = np.s_[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
    corner = np.array([cols[0] * 0.05, rows[0] * 0.05, 0.0])
    cells = np.where(known, world.cells, -1).astype(np.int8)[part]
    return OccupancyGrid(cells.copy(), 0.05, se2.compose(world.origin_xyyaw, corner))


def log_of_two_worlds(seconds, at_s, before, after):
    """The synthetic log of a world that becomes another one at a time."""
    bundle = synthetic_bundle(seconds=seconds, world=before)
    scans = [synthetic_bundle(seconds=seconds, world=w).table("scans") for w in (before, after)]
    parts = [scans[0].take(scans[0].t_ns < at(at_s)), scans[1].take(scans[1].t_ns >= at(at_s))]
    return rebuilt(bundle, {"scans": Table.concat(TABLES["scans"], parts)})
