"""What a log says of each place of its map: when the robot was there, lost, and what beams saw."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.freshness import NEVER, Freshness
from slamreplay.bundle.products import Hindsight
from slamreplay.evidence.result import Postmortem
from slamreplay.fleet.schema import PLACE_M, STEP
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S

#: A pose holds until the next one, but no longer than this.
_HOLD_NS = NS_PER_S
#: Where a robot became lost is told by a pose this near in time.
_NEAR_NS = 3 * NS_PER_S
#: Columns of `places` that add up, those of time first.
_TIMED, _SEEN = ("here_s", "lost_s", "entered_lost"), ("seen_m2", "contradicted_m2")


def places_of(post: Postmortem) -> dict[str, NDArray[np.generic]]:
    """The columns of `places` but for `key`, one row per place that the log tells something of.

    Where the maps of the log were of several places, each has rows of its own. Sums are multiples
    of `STEP`. Rows are in the order of the maps' first use, then by column and row.
    """
    found: dict[str, list[tuple[NDArray[np.int64], dict[str, se2.Array]]]] = {}
    for version, hindsight, start_ns, end_ns in _maps(post):
        layers = found.setdefault(version, [])
        layers.append(_times(post, hindsight, start_ns, end_ns))
        if hindsight.changes is not None and hindsight.changes.freshness is not None:
            layers.append(_looks(hindsight.changes.freshness))
    tables = [_summed(version, layers) for version, layers in found.items()]
    names = ("map_version", "col", "row", *_TIMED, *_SEEN)
    if not tables:
        return {name: np.empty(0) for name in names}
    return {name: np.concatenate([table[name] for table in tables]) for name in names}


def _maps(post: Postmortem) -> Iterator[tuple[str, Hindsight, int, int]]:
    """Each map the log was judged against, what was found in it, and [start, end) of its time."""
    if post.hindsight is None:
        return
    for part in post.hindsight.parts:
        stretch = part.stretch
        yield stretch.version, part.hindsight, stretch.start_ns, stretch.end_ns
    if not post.hindsight.parts and post.grid is not None:
        start_ns, end_ns = post.manifest.start_ns, post.manifest.end_ns
        yield post.grid.version, post.hindsight, start_ns, end_ns + 1


def became_lost(post: Postmortem) -> NDArray[np.int64]:
    """(K,) when the robot became lost: a change of the map meanwhile is no new beginning."""
    intervals = post.judgement.intervals
    first = [i.start_ns for i in intervals[:1] if i.is_lost]
    later = [b.start_ns for a, b in pairwise(intervals) if b.is_lost and not a.is_lost]
    return np.array(first + later, dtype=np.int64)


def _times(
    post: Postmortem, hindsight: Hindsight, start_ns: int, end_ns: int
) -> tuple[NDArray[np.int64], dict[str, se2.Array]]:
    """Places of each pose, with the time it stands for, and of each moment of becoming lost."""
    track = hindsight.track.take(hindsight.track.has_pose)
    track = track.take((track.t_ns >= start_ns) & (track.t_ns < end_ns))
    track = track.take(np.argsort(track.t_ns, kind="stable"))
    t, lost = track.t_ns, _when_lost(post)
    held = np.minimum(np.diff(t, append=min(end_ns, post.manifest.end_ns)), _HOLD_NS)
    held = np.maximum(held, 0) / NS_PER_S
    is_lost = np.searchsorted(lost.ravel(), t, side="right") % 2 == 1
    began = became_lost(post)
    began = began[(began >= start_ns) & (began < end_ns)]
    near, known = np.empty(0, dtype=np.int64), np.empty(0, dtype=bool)
    if len(t):
        after = np.searchsorted(t, began)
        around = np.clip(np.stack([after - 1, after]), 0, len(t) - 1)
        off = np.abs(t[around] - began)
        near = around[np.argmin(off, axis=0), np.arange(len(began))]
        known = off.min(axis=0) <= _NEAR_NS
    where = _code(track.xyyaw[:, :2])
    at = near[known]
    zeros, ones = np.zeros(len(at)), np.zeros(len(t))
    return np.append(where, where[at]), {
        "here_s": np.append(held, zeros),
        "lost_s": np.append(held * is_lost, zeros),
        "entered_lost": np.append(ones, zeros + 1.0),
    }


def _when_lost(post: Postmortem) -> NDArray[np.int64]:
    """(K, 2) stretches [start, end) of being lost, in order."""
    spans = [(i.start_ns, i.end_ns) for i in post.judgement.intervals if i.is_lost]
    return np.array(spans, dtype=np.int64).reshape(-1, 2)


def _looks(fresh: Freshness) -> tuple[NDArray[np.int64], dict[str, se2.Array]]:
    """Places of the lattice's cells that beams checked, with their areas."""
    confirmed, contradicted = fresh.confirmed_ns, fresh.contradicted_ns
    row, col = np.nonzero((confirmed != NEVER) | (contradicted != NEVER))
    local = (np.column_stack([col, row]) + 0.5) * fresh.resolution_m
    against = contradicted[row, col] > confirmed[row, col]
    m2 = np.full(len(row), fresh.resolution_m**2)
    where = _code(se2.transform_points(fresh.origin_xyyaw, local))
    return where, {"seen_m2": m2, "contradicted_m2": m2 * against}


def _code(xy_m: se2.Array) -> NDArray[np.int64]:
    """(N,) one number per place, in the order of column and row."""
    col, row = np.floor(xy_m / PLACE_M).astype(np.int64).T
    return (col << 32) + (row + (1 << 31))


def _summed(
    version: str, layers: list[tuple[NDArray[np.int64], dict[str, se2.Array]]]
) -> dict[str, NDArray[np.generic]]:
    codes = np.concatenate([where for where, _ in layers])
    places, index = np.unique(codes, return_inverse=True)
    sums = {name: np.zeros(len(places)) for name in (*_TIMED, *_SEEN)}
    start = 0
    for where, columns in layers:
        rows = index[start : start + len(where)]
        start += len(where)
        for name, values in columns.items():
            found = np.bincount(rows, weights=values, minlength=len(places))
            # A map that held twice was looked at twice: its area does not grow.
            keep = np.maximum if name in _SEEN else np.add
            sums[name] = keep(sums[name], found)
    return {
        "map_version": np.full(len(places), version, dtype=object),
        "col": (places >> 32).astype(np.int32),
        "row": ((places & 0xFFFFFFFF) - (1 << 31)).astype(np.int32),
        **{name: np.rint(values / STEP) * STEP for name, values in sums.items()},
    }
