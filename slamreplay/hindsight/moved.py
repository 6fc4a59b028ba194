"""What was carried from one place to another: shapes that are gone here and new there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects, label
from scipy.spatial import cKDTree

from slamreplay.geometry import se2
from slamreplay.matching.field import WorkingMap

#: Two regions are one thing that moved if this share of what appeared lies on the outline of what
#: is gone, this near, once laid over it; and if that covers this share of the outline.
ALIKE_SHARE, ALIKE_M, COVERED_SHARE = 0.9, 0.12, 0.35
#: Their lengths differ by no more than this, m; smaller things look all alike.
LENGTH_M, SMALLEST_M = 0.3, 0.3
#: Within this distance one end of a thing, seen for this share of its length, or a single face of
#: it, is enough to know it again; beyond the other distance nothing is.
NEAR_M, SEEN_SHARE, FAR_M = 3.0, 0.6, 10.0
#: The mapped thing that a removed patch is part of: no larger, and the patch is so much of it.
THING_M, PATCH_SHARE = 10.0, 0.15


def outlines(
    working: WorkingMap, centres: list[se2.Array], cells: list[NDArray[np.int64]]
) -> list[se2.Array]:
    """(K, 2) the mapped outline of what each removed patch was part of, or else the patch itself.

    What moved by less than its own size covers part of its old place, which then is not removed.

    Args:
        working: the map.
        centres: of each patch (N, 2) the centres of its cells, m in the grid's frame.
        cells: of each patch (N, 2) rows and columns.
    """
    labels, _ = label(working.walls, np.ones((3, 3)))
    boxes = find_objects(labels)
    things = []
    for thing, own in zip(centres, cells, strict=True):
        number = int(np.argmax(np.bincount(labels[tuple(own.T)])))
        if number:
            box = boxes[number - 1]
            size_m = max(s.stop - s.start for s in box) * working.resolution_m
            all_cells = np.argwhere(labels[box] == number) + [s.start for s in box]
            if size_m <= THING_M and len(own) >= PATCH_SHARE * len(all_cells):
                whole = working.corner_xy + (all_cells[:, ::-1] + 0.5) * working.resolution_m
                things.append(whole)
                continue
        things.append(thing)
    return things


def pairs(new: list[se2.Array], old: list[se2.Array]) -> list[tuple[int, int, float]]:
    """Index in `new`, index in `old` and likeness of what moved, each at most once."""
    upright_old = [_upright(b) for b in old]
    likeness = np.array(
        [
            [_alike(a, b, upright, c) for b, c in zip(old, upright_old, strict=True)]
            for a, upright in ((a, _upright(a)) for a in new)
        ]
    )
    found: list[tuple[int, int, float]] = []
    while likeness.size and likeness.max() > 0.0:
        i, j = np.unravel_index(np.argmax(likeness), likeness.shape)
        found.append((int(i), int(j), float(likeness[i, j])))
        likeness[i, :], likeness[:, j] = 0.0, 0.0
    return found


def _alike(new: se2.Array, old: se2.Array, new_box: se2.Array, old_box: se2.Array) -> float:
    """How much two outlines look alike, 0 (not) to 1.

    What was removed is seen on all sides, for beams go through it; of what appeared often only one
    side is. So the new outline is laid over the old one, corner on corner, in all four headings.

    Args:
        new: (N, 2) cells of what appeared, m.
        old: (M, 2) cells of what is gone, m.
        new_box: (N, 2) the same `_upright`.
        old_box: (M, 2) likewise.
    """
    way = float(np.hypot(*(_middle(new) - _middle(old))))
    if way > FAR_M:
        return 0.0
    new_size, old_size = np.sort(new_box.max(axis=0)), np.sort(old_box.max(axis=0))
    least = old_size[1] - LENGTH_M
    if way <= NEAR_M:
        least = min(least, SEEN_SHARE * old_size[1])
    elif new_size[0] < SMALLEST_M:
        return 0.0
    if not max(SMALLEST_M, least) <= new_size[1] <= old_size[1] + LENGTH_M:
        return 0.0
    if new_size[0] > old_size[0] + LENGTH_M:
        return 0.0
    outline, best = cKDTree(old_box), 0.0
    size = old_box.max(axis=0)
    least_covered = COVERED_SHARE if way > NEAR_M else SEEN_SHARE * COVERED_SHARE
    for quarter in range(4):
        turned = se2.transform_points(np.array([0.0, 0.0, quarter * np.pi / 2.0]), new_box)
        turned = turned - turned.min(axis=0)
        slack = size - turned.max(axis=0)
        for corner in np.array([[0, 0], [0, 1], [1, 0], [1, 1]]):
            laid = turned + corner * slack
            on_it = float(np.mean(outline.query(laid)[0] <= ALIKE_M))
            covered = float(np.mean(cKDTree(laid).query(old_box)[0] <= ALIKE_M))
            if on_it >= ALIKE_SHARE and covered >= least_covered:
                best = max(best, on_it * (0.5 + 0.5 * covered))
    return best / (1.0 + way / FAR_M)  # of two like ones the nearer


def _middle(points: se2.Array) -> se2.Array:
    return np.asarray(0.5 * (points.min(axis=0) + points.max(axis=0)))


def _upright(points: se2.Array) -> se2.Array:
    """Points (N, 2) turned so that their bounding rectangle is smallest, its corner at 0, 0."""
    turned = [
        se2.transform_points(np.array([0.0, 0.0, angle]), points)
        for angle in np.radians(np.arange(0.0, 90.0, 2.0))
    ]
    sizes = np.array([np.ptp(p, axis=0) for p in turned])
    best = turned[int(np.argmin(np.prod(sizes + 0.05, axis=1)))]
    return np.asarray(best - best.min(axis=0))
