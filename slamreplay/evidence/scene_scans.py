"""Scans of a scene: which ones are shown, where their beams ended, and what these met."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.met import BeamsMet, Met
from slamreplay.bundle.scans import ScanSet, scan_sets
from slamreplay.bundle.view import BundleView
from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.scene import SceneScans
from slamreplay.geometry.times import NS_PER_S
from slamreplay.hindsight.beams import HIT, INVALID, beams_of

#: So far before and after something happened scans are shown more densely.
AROUND_NS = 3 * NS_PER_S
#: Share of the scans that are shown for what happened near them; the others lie evenly in time.
_DENSE_SHARE = 0.5


def scene_scans(
    post: Postmortem, view: BundleView, moments_ns: Sequence[int], most: int | None
) -> tuple[SceneScans, ...]:
    """Scans of every laser with what their beams met.

    Args:
        post: what was found.
        view: the log.
        moments_ns: when something happened: scans are denser there.
        most: of each laser; None for all of them.
    """
    lasers = scan_sets(view)
    if not lasers:
        return ()
    rows = chosen(lasers[0].t_ns, moments_ns, most)
    changes = None if post.hindsight is None else post.hindsight.changes
    found = []
    for k, laser in enumerate(lasers):
        # Another laser is shown at the moments of the first, to be drawn together.
        own = rows if k == 0 or most is None else nearest(laser.t_ns, lasers[0].t_ns[rows])
        own = np.arange(len(laser)) if most is None else own
        told = changes.met[k] if changes is not None and k < len(changes.met) else None
        found.append(_of_one(post, _only(laser, own), told))
    return tuple(found)


def scans_in_pieces(
    post: Postmortem, view: BundleView, number: int, rows: slice, most: int = 512
) -> Iterator[SceneScans]:
    """All scans of one laser, a few hundred at a time: those of a long log fill the memory.

    Args:
        post: what was found.
        view: the log.
        number: of the laser, from 0.
        rows: which of its scans, by time.
        most: about so many in a piece; scans of one and the same time are not parted.
    """
    laser = scan_sets(view)[number]
    changes = None if post.hindsight is None else post.hindsight.changes
    told = changes.met[number] if changes is not None and number < len(changes.met) else None
    first, stop, _ = rows.indices(len(laser))
    while first < stop:
        last_ns = laser.t_ns[min(first + most, stop) - 1]
        end = min(int(np.searchsorted(laser.t_ns, last_ns, side="right")), stop)
        yield _of_one(post, _only(laser, np.arange(first, end)), told)
        first = end


def chosen(
    t_ns: NDArray[np.int64], moments_ns: Sequence[int], most: int | None
) -> NDArray[np.int64]:
    """Rows of times (N,), ascending: evenly in time with the first and last, denser near moments.

    Args:
        t_ns: (N,) ascending.
        moments_ns: shared out evenly among them is half of what may be shown.
        most: how many at the most, two or more; None for all.
    """
    if most is None or len(t_ns) <= most:
        return np.arange(len(t_ns))
    moments = np.unique(np.asarray(moments_ns, dtype=np.int64))
    room = max(min(int(_DENSE_SHARE * most), most - 2), 0)
    if len(moments) > room:  # some of them, evenly
        moments = moments[np.linspace(0, len(moments) - 1, room).astype(np.int64)]
    dense = np.zeros(0, dtype=np.int64)
    if len(moments):
        each = room // len(moments)
        steps = np.linspace(-AROUND_NS, AROUND_NS, each + 1)[:-1] + AROUND_NS / each
        around = (moments[:, None] + steps.astype(np.int64)).ravel()
        around = around[(around >= t_ns[0]) & (around <= t_ns[-1])]
        dense = nearest(t_ns, around)
    even = np.linspace(t_ns[0], t_ns[-1], max(most - len(dense), 2)).astype(np.int64)
    return np.union1d(dense, nearest(t_ns, even))


def nearest(t_ns: NDArray[np.int64], asked_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Rows of times (N,), ascending, that are nearest to the asked ones (M,); each once."""
    after = np.clip(np.searchsorted(t_ns, asked_ns), 0, len(t_ns) - 1)
    before = np.maximum(after - 1, 0)
    earlier = asked_ns - t_ns[before] < t_ns[after] - asked_ns
    return np.unique(np.where(earlier, before, after))


def _of_one(post: Postmortem, laser: ScanSet, told: BeamsMet | None) -> SceneScans:
    motion = laser.odometry
    if motion is None and post.hindsight is not None:
        motion = post.hindsight.track
    beams = beams_of(laser, motion)
    met = np.full(beams.kind.shape, Met.OTHER, dtype=np.uint8)
    if told is not None:
        met = told.at(beams.t_ns, beams.kind.shape[1])
    met[beams.kind == INVALID] = Met.INVALID
    return SceneScans(beams.t_ns, beams.ends, beams.kind == HIT, met, beams.laser_xy)


def _only(laser: ScanSet, rows: NDArray[np.int64]) -> ScanSet:
    if len(rows) == len(laser):
        return laser
    return replace(
        laser,
        t_ns=laser.t_ns[rows],
        ranges_m=laser.ranges_m[rows],
        angle_min=laser.angle_min[rows],
        angle_increment=laser.angle_increment[rows],
        time_increment_s=laser.time_increment_s[rows],
        hits=laser.hits[rows],
        misses=laser.misses[rows],
        range_max_m=laser.range_max_m[rows],
    )
