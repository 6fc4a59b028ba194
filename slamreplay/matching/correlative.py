"""Correlative scan matching in a window, and the climb from there to the top of the score.

The window search is Olson's (Real-time correlative scan matching, ICRA 2009) on one level: every
pose of a lattice is scored. The climb is Newton's method on the summed score itself, its first and
second derivatives taken by central differences.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.matching import kernels
from slamreplay.matching.field import ScoreField
from slamreplay.matching.threads import share_out

#: So many jobs are worth a thread of their own.
_WORTH_A_THREAD = 16


@dataclass(frozen=True)
class Window:
    """Poses to try: plus and minus `reach` in steps, in metres and radians.

    `pull` is taken off the score at the window's edge, less towards its middle: it keeps a match
    that the points do not hold (along a corridor) where it was expected.
    """

    reach_m: float
    step_m: float
    reach_rad: float
    step_rad: float
    pull: float = 0.0


@dataclass(frozen=True, eq=False)
class Match:
    """A matched pose.

    Attributes:
        xyyaw: (3,) in the field's frame.
        score: mean over the points, 0 to 1.
        information: (3, 3) of x y yaw about the field's axes, from the curvature of the score.
    """

    xyyaw: se2.Array
    score: float
    information: se2.Array


@dataclass(frozen=True, eq=False)
class Matches:
    """N matched poses: `xyyaw` (N, 3), `score` (N,) and `information` (N, 3, 3), as in `Match`."""

    xyyaw: se2.Array
    score: se2.Array
    information: se2.Array


def search_window(
    field: ScoreField, points: se2.Array, centre: se2.Array, window: Window
) -> tuple[se2.Array, float]:
    """The best pose (3,) of a window around `centre` and its mean score (without the pull)."""
    best = np.append(np.asarray(centre, dtype=np.float64), 0.0)
    shape = _shape(window)
    totals, cells = _window_scratch(shape[None])
    points = np.ascontiguousarray(points)
    kernels.search(*_frame(field), points, shape, best, totals, cells)
    return best[:3], float(best[3])


def climb(field: ScoreField, points: se2.Array, start: se2.Array) -> Match:
    """The top of the score near `start` (within some centimetres), with its curvature."""
    return _only(match_each(field, [points], np.asarray(start)[None], None))


def match(field: ScoreField, points: se2.Array, centre: se2.Array, window: Window) -> Match:
    """Window search, then the climb."""
    return _only(match_each(field, [points], np.asarray(centre)[None], window))


def match_each(
    field: ScoreField,
    clouds: Sequence[se2.Array],
    centres: se2.Array,
    window: Window | Sequence[Window] | None,
) -> Matches:
    """`match` for many at once, on all cores.

    Args:
        field: the field of all of them.
        clouds: points (M, 2) of each of N, or of one that is matched at N places.
        centres: (N, 3) where to look.
        window: of all or of each; None climbs only.
    """
    # Arrays of one layout, writeable: the kernel is compiled once for each kind it is handed.
    poses = np.array(centres, dtype=np.float64, order="C").reshape(-1, 3)
    count = len(poses)
    stops = np.cumsum([0, *map(len, clouds)], dtype=np.int64)
    bounds = np.column_stack([stops[:-1], stops[1:]])
    bounds = np.broadcast_to(bounds, (count, 2)).copy()
    points = np.concatenate([np.empty((0, 2)), *clouds])
    if isinstance(window, Sequence):
        shapes = np.array([_shape(w) for w in window]).reshape(count, 5)
    else:
        shapes = np.zeros((count, 5)) + (0.0 if window is None else _shape(window))
    found = Matches(poses, np.zeros(count), np.zeros((count, 3, 3)))
    out = (found.xyyaw, found.score, found.information)

    def work(first: int, stop: int) -> None:
        scratch = (
            *_window_scratch(shapes),
            np.zeros(4),
            np.zeros((3, 3, 3)),
            np.zeros((3, 3)),
            np.zeros((3, 3)),
        )
        kernels.match_jobs(_frame(field), points, bounds, shapes, first, stop, out, scratch)

    if count:
        share_out(count, work, _WORTH_A_THREAD)
    return found


def _only(found: Matches) -> Match:
    return Match(found.xyyaw[0], float(found.score[0]), found.information[0])


def _frame(field: ScoreField) -> tuple[NDArray[np.float32], float, float, float]:
    return field.values, field.resolution_m, float(field.corner_xy[0]), float(field.corner_xy[1])


def _shape(window: Window) -> se2.Array:
    return np.array([window.reach_m, window.step_m, window.reach_rad, window.step_rad, window.pull])


def _window_scratch(shapes: se2.Array) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Sums of the largest window's places, and the cells of a point shifted to them."""
    reach = np.ceil(shapes[:, 0] / np.where(shapes[:, 1] > 0.0, shapes[:, 1], 1.0))
    side = 2 * int(reach.max(initial=0.0)) + 1
    return np.zeros((side, side), dtype=np.float32), np.zeros((2, side), dtype=np.int64)
