"""Costmaps that were cleared: most of what was lethal gone from one costmap to the next.

A call of clear_costmaps leaves no trace of its own. What it clears and the sensors see again is
marked anew before the next costmap is sent, so only what they do not see stays away, and many a
call is not found. What is found is not people who walk off: they are a few cells on one side.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Table
from slamreplay.geometry.times import NS_PER_S

#: nav_msgs/OccupancyGrid's cost of a lethal cell.
LETHAL = 100
#: Fewer cells than this may be a few people: a lidar sees about 15 cells of 5 cm of each.
CELLS = 100
#: At most this share of them is left; a crowd that walks off is still in the next costmap.
LEFT = 0.2
#: What went was on at least three sides of the robot, a tenth of it on each.
SIDES, SIDE_SHARE = 3, 0.1
#: Costmaps farther apart than this show another place.
APART_NS = 5 * NS_PER_S
#: A rolling window must share so much of its edge with the one before.
OVERLAP = 0.5


def clearings(costmaps: Iterable[Table]) -> list[tuple[int, str, int]]:
    """Time, topic and log time of each costmap that shows a clearing since the one before it.

    Args:
        costmaps: the table part by part, its rows in time order.
    """
    found = []
    last: dict[str, Table] = {}
    for part in costmaps:
        for topic in sorted(set(part["topic"])):
            table = part.take(part["topic"] == topic)
            if topic in last:
                table = Table.concat(table.schema, [last[topic], table])
            last[topic] = table.take(np.array([len(table) - 1]))
            times = table.t_ns.tolist(), table["t_log_ns"].tolist()
            found += [(times[0][k], str(topic), times[1][k]) for k in _of_topic(table)]
    return sorted(found)


def _of_topic(table: Table) -> list[int]:
    """Rows of one topic's costmaps, in time order, that show a clearing."""
    cells = table["cells"]
    counts = np.concatenate([[0], np.cumsum(cells.values == LETHAL)])
    lethal = np.diff(counts[cells.offsets])
    before, after = lethal[:-1], lethal[1:]
    same = np.diff(table.t_ns) <= APART_NS
    for name in ("width", "height", "resolution_m"):
        same &= table[name][1:] == table[name][:-1]
    rows = np.flatnonzero(same & (before >= CELLS) & (after <= LEFT * before)) + 1
    return [int(k) for k in rows if _is_cleared(*_overlap(table, int(k)))]


def _overlap(table: Table, row: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Lethal cells of a costmap and of the one before it where both are, (0, 0) without any."""
    shape = int(table["height"][row]), int(table["width"][row])
    old, new = (table["cells"][k].reshape(shape) == LETHAL for k in (row - 1, row))
    step = table["origin_xyyaw"][row] - table["origin_xyyaw"][row - 1]
    dx, dy = np.rint(step[:2] / table["resolution_m"][row]).astype(int)
    sizes = shape[1] - abs(dx), shape[0] - abs(dy)
    if step[2] or sizes[0] < OVERLAP * shape[1] or sizes[1] < OVERLAP * shape[0]:
        return old[:0, :0], new[:0, :0]
    x, y, width, height = max(dx, 0), max(dy, 0), *sizes
    moved = new[y - dy : y - dy + height, x - dx : x - dx + width]
    return old[y : y + height, x : x + width], moved


def _is_cleared(old: NDArray[np.bool_], new: NDArray[np.bool_]) -> bool:
    """Whether most lethal cells (H, W) went, and went on all sides of the middle."""
    count = int(old.sum())
    if count < CELLS or int((old & new).sum()) > LEFT * count or int(new.sum()) > LEFT * count:
        return False
    rows, columns = np.nonzero(old & ~new)
    quadrant = 2 * (rows >= old.shape[0] / 2) + (columns >= old.shape[1] / 2)
    shares = np.bincount(quadrant, minlength=4) / len(rows)
    return bool((shares >= SIDE_SHARE).sum() >= SIDES)
