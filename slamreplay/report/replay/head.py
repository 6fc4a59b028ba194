"""The head of the payload: names, limits, marks, regions and where to begin; all of it plain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.products import ChangedRegion
from slamreplay.bundle.track import PoseTrack
from slamreplay.evidence.clean import clean, straight
from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.scene import Mark, Scene
from slamreplay.evidence.words import STATES
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.report.replay.beams import END_M
from slamreplay.report.replay.ground import OCCUPIED, Ground
from slamreplay.report.replay.overlays import POINT_M, TURN_RAD
from slamreplay.report.replay.tracks import HEADING_RAD, PLACE_M, Ticks
from slamreplay.verdict.judgement import Interval

#: Around what is shown, m; a map up to this many times larger than the paths is shown whole.
_MARGIN_M, _WHOLE_UP_TO = 1.5, 1.7
#: A map this much wider than tall needs less height, one this much taller than wide more.
_WIDE, _TALL = 2.6, 1.2
#: Letters of a text of the log that travel: no screen has room for more.
_MOST_LETTERS = 240


def head_of(
    post: Postmortem,
    scene: Scene,
    tracks: Mapping[str, PoseTrack],
    ticks: Ticks,
    origin: se2.Array,
    ground: Ground | None,
) -> dict[str, Any]:
    """Plain values by name; times are seconds since the log's start, for the page to print."""
    odometry = "odometry" in tracks
    frames = post.manifest.frames
    regions = [] if odometry else _regions(post)
    return {
        "end_s": _seconds(post, post.manifest.end_ns),
        "tick_s": ticks.tick_ns / NS_PER_S,
        "origin": _rounded(origin),
        "place_m": PLACE_M,
        "heading_rad": HEADING_RAD,
        "end_m": END_M,
        "point_m": POINT_M,
        "turn_rad": TURN_RAD,
        "frame": _text((frames.odom or "odom") if odometry else (frames.map or "map")),
        "tracks": list(tracks),
        "footprint": [_rounded(corner) for corner in scene.footprint_xy],
        "ground": None if ground is None else _ground(ground),
        "regions": [_region(k, r) for k, r in enumerate(regions, start=1) if not r.map_version],
        "stops": [] if odometry else list(_stops(post)),
        "states": [
            [i.state, STATES[i.state].name, _seconds(post, i.start_ns), _seconds(post, i.end_ns)]
            for i in post.judgement.intervals
        ],
        "marks": [_mark(post, mark) for mark in scene.marks],
        "lanes": [
            {"key": one.key, "title": one.title, "unit": one.unit, "limit": _number(one.limit)}
            for one in scene.lanes
        ],
        "window": _window(tracks, regions, ground),
        "open_s": _opens(post, scene, tracks),
    }


def shape_of(head: Mapping[str, Any]) -> str:
    """How tall the map shall be: none without one, wide or tall where the place is, else plain."""
    if head["window"] is None:
        return "none"
    x0, y0, x1, y1 = head["window"]
    if x1 - x0 > _WIDE * (y1 - y0):
        return "wide"
    return "tall" if y1 - y0 > _TALL * (x1 - x0) else "plain"


def _seconds(post: Postmortem, t_ns: int) -> float:
    return round((t_ns - post.manifest.start_ns) / NS_PER_S, 4)


def _number(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(f"{value:.6g}")


def _rounded(values: se2.Array) -> list[float]:
    return [round(float(v), 4) for v in values]


def _ground(ground: Ground) -> dict[str, object]:
    return {
        "cell_m": ground.cell_m,
        "corner": _rounded(np.array(ground.corner)),
        "origin": [round(v, 7) for v in ground.origin_xyyaw],
    }


def _regions(post: Postmortem) -> list[ChangedRegion]:
    changes = None if post.hindsight is None else post.hindsight.changes
    return [] if changes is None else list(changes.regions)


def _region(number: int, region: ChangedRegion) -> dict[str, object]:
    came_from = None if region.from_bbox_m is None else _rounded(np.array(region.from_bbox_m))
    box = _rounded(np.array(region.bbox_m))
    return {"name": f"R{number}", "kind": region.kind, "box": box, "from": came_from}


def _stops(post: Postmortem) -> Iterator[dict[str, object]]:
    for number, stop in enumerate(post.judgement.stops, start=1):
        if stop.x_m is None or stop.y_m is None or stop.t_ns < post.drawn_from_ns:
            continue
        x, y = _rounded(np.array([stop.x_m, stop.y_m]))
        yield {"number": number, "x": x, "y": y, "t": _seconds(post, stop.t_ns)}


def _mark(post: Postmortem, mark: Mark) -> dict[str, object]:
    """A mark on the timeline: what began before the log's start stands at its edge."""
    first, last = post.manifest.start_ns, post.manifest.end_ns
    t_ns = min(max(mark.t_ns, first), last)
    end_ns = None if mark.end_ns is None else min(max(mark.end_ns, t_ns), last)
    return {
        "kind": mark.kind,
        "t": _seconds(post, t_ns),
        "end": None if end_ns is None else _seconds(post, end_ns),
        "title": _text(mark.title),
        "severity": mark.severity,
    }


def _text(text: str) -> str:
    """A text of the log as the rest of the page has it: the payload is not cleaned with it."""
    shown = straight(clean(text))
    return shown if len(shown) <= _MOST_LETTERS else f"{shown[: _MOST_LETTERS - 3]}..."


def _window(
    tracks: Mapping[str, PoseTrack], regions: Sequence[ChangedRegion], ground: Ground | None
) -> list[float] | None:
    """x_min, y_min, x_max, y_max of what is worth showing, m; None without any path."""
    if not tracks:
        return None
    points = [track.xyyaw[track.has_pose, :2] for track in tracks.values()]
    points += [np.reshape(r.bbox_m, (2, 2)) for r in regions if not r.map_version]
    every = np.concatenate(points)
    low, high = every.min(axis=0) - _MARGIN_M, every.max(axis=0) + _MARGIN_M
    if ground is not None and (walls := ground.codes & OCCUPIED).any():
        rows, columns = np.flatnonzero(walls.any(axis=1)), np.flatnonzero(walls.any(axis=0))
        ends = np.array([[columns[0], rows[0]], [columns[-1] + 1, rows[-1] + 1]]) * ground.cell_m
        (x0, y0), (x1, y1) = ends + np.array(ground.corner)
        corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
        corners = se2.transform_points(np.array(ground.origin_xyyaw), corners)
        whole_low, whole_high = corners.min(axis=0) - 0.5, corners.max(axis=0) + 0.5
        if (whole_high - whole_low <= _WHOLE_UP_TO * (high - low)).all():
            low, high = np.minimum(low, whole_low), np.maximum(high, whole_high)
    return _rounded(np.concatenate([low, high]))


def _opens(post: Postmortem, scene: Scene, tracks: Mapping[str, PoseTrack]) -> float:
    """When the replay opens: the belief or the map most wrong while it was, or the start.

    A moment with something to see: with every path known, and a scan.
    """
    if not tracks:
        return 0.0
    since, error = post.drawn_from_ns, post.error
    intervals = post.judgement.intervals
    if error is not None:  # elsewhere than while it was lost nobody vouches for the distance
        lost = [i for i in intervals if i.is_lost]
        worst = _worst(error.t_ns, error.distance_m, lost, since)
        if worst is not None:
            return _seconds(post, worst)
    seen_from = max(since, _seen_from(scene, tracks))
    changes = None if post.hindsight is None else post.hindsight.changes
    if changes is not None:
        changed = [i for i in intervals if i.is_changed]
        worst = _worst(changes.t_ns, changes.changed_share, changed, seen_from)
        if worst is not None:
            return _seconds(post, worst)
    return max(_seconds(post, seen_from), 0.0)


def _worst(
    t_ns: NDArray[np.int64], values: se2.Array, stretches: Sequence[Interval], since_ns: int
) -> int | None:
    """When a value was the greatest within some stretches; None where it is not known in any."""
    within = np.zeros(len(t_ns), dtype=bool)
    for i in stretches:
        within |= (t_ns >= max(i.start_ns, since_ns)) & (t_ns < i.end_ns)
    shown = np.where(within, values, np.nan)
    return int(t_ns[np.nanargmax(shown)]) if np.isfinite(shown).any() else None


def _seen_from(scene: Scene, tracks: Mapping[str, PoseTrack]) -> int:
    """When every path is known, at the first scan after it; when one is, without any scan."""
    first = [int(track.t_ns[track.has_pose][0]) for track in tracks.values()]
    for t_ns in (scans.t_ns for scans in scene.scans):
        after = t_ns[t_ns >= max(first)]
        if len(after):
            return int(after[0])
    return min(first)
