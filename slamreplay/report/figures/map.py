"""The map with both paths, where they part, and what of the map is not true."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from slamreplay.bundle.products import ChangedRegion
from slamreplay.evidence.result import Postmortem
from slamreplay.geometry import se2
from slamreplay.report.figures import canvas
from slamreplay.report.figures.canvas import (
    BLUE,
    FAINT,
    INK,
    VERMILLION,
    Part,
)
from slamreplay.report.figures.fitted import fit_plane
from slamreplay.report.figures.map_cells import draw_grid

_MARGIN_M = 2.5
#: So many regions, the largest, bear their number; the others' would hide the map.
NAMED = 6


def map_figure(post: Postmortem, width_in: float) -> Figure | None:
    """Believed and hindsight path on the map; None where no path is known at all."""
    if not map_parts(post):
        return None
    size = canvas.text_size(width_in)
    figure = canvas.new_figure(width_in, width_in)
    axes = figure.add_subplot()
    handles = draw_map(axes, post, size)
    # Equal axes leave the rest of their box empty: the paper is cut to what they need.
    fit_plane(figure, np.ptp(axes.get_ylim()) / np.ptp(axes.get_xlim()), handles, width_in)
    return figure


def map_parts(post: Postmortem) -> tuple[Part, ...]:
    """The map; nothing where no path is known."""
    if _paths(_in_last_map(post)) is None:
        return ()
    return (Part("map", lambda axes, size: draw_map(axes, post, size)),)


def draw_map(axes: Axes, post: Postmortem, size: float = 9.5) -> list[object]:
    """Draw both paths on the map, where they part, the stops and the regions.

    Args:
        axes: to draw in; their limits and aspect are set.
        post: with a path at least.
        size: of the text, points.

    Returns:
        Handles for a legend.
    """
    post = _in_last_map(post)
    found = _paths(post)
    if found is None:
        return []
    paths, alone = found
    low, high = _window(post, paths)
    handles: list[object] = []
    if post.grid is not None and alone is None:
        handles += draw_grid(axes, post, post.grid, low, high)
    frame = post.manifest.frames.odom if alone is not None else post.manifest.frames.map
    frame = frame or ("odom" if alone is not None else "map")
    canvas.dress(axes, f"x in {frame} [m]", f"y in {frame} [m]", size)
    axes.set_aspect("equal")
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    handles += _draw_paths(axes, post, alone)
    handles += _draw_parting(axes, post, size)
    handles += _draw_stops(axes, post, size)
    _draw_regions(axes, post, size)
    return handles


def _paths(post: Postmortem) -> tuple[list[se2.Array], se2.Array | None] | None:
    """What is drawn, and odometry's path where that is all there is; None without any."""
    paths = [p for p in (_path(post, "hindsight"), _path(post, "belief")) if p is not None]
    if paths:
        return paths, None
    alone = _path(post, "odometry")
    return None if alone is None else ([alone], alone)


def _in_last_map(post: Postmortem) -> Postmortem:
    """Without what cannot be drawn in the map at the end: the log was in another place then."""
    hindsight, since = post.hindsight, post.drawn_from_ns
    if hindsight is None or since == post.manifest.start_ns:
        return post
    changes, belief = hindsight.changes, post.belief
    if changes is not None:
        here = tuple(r for r in changes.regions if r.map_version is None)
        changes = replace(changes, regions=here)
    track = hindsight.track.take(hindsight.track.t_ns >= since)
    stops = tuple(
        replace(s, x_m=None, y_m=None) if s.t_ns < since else s for s in post.judgement.stops
    )
    return replace(
        post,
        hindsight=replace(hindsight, track=track, changes=changes),
        belief=None if belief is None else belief.take(belief.t_ns >= since),
        judgement=replace(post.judgement, stops=stops),
    )


def _path(post: Postmortem, name: str) -> se2.Array | None:
    track = {
        "belief": post.belief,
        "hindsight": None if post.hindsight is None else post.hindsight.track,
        "odometry": post.odometry,
    }[name]
    if track is None or not track.has_pose.any():
        return None
    return track.xyyaw


def _window(post: Postmortem, paths: list[se2.Array]) -> tuple[se2.Array, se2.Array]:
    """Lower left and upper right corner of what is worth showing, m: not narrower than 3:1."""
    points = [p[:, :2] for p in paths]
    points += [np.reshape(r.bbox_m, (2, 2)) for r in _regions(post)]
    every = np.concatenate(points)
    every = every[np.isfinite(every).all(axis=1)]
    low, high = every.min(axis=0) - _MARGIN_M, every.max(axis=0) + _MARGIN_M
    if post.grid is not None and len(walls := np.argwhere(post.grid.occupied)):
        # A map not much larger than the paths is shown whole: its outer walls are landmarks.
        xy = post.grid.centre_of(walls)
        whole_low, whole_high = xy.min(axis=0) - 0.5, xy.max(axis=0) + 0.5
        if (whole_high - whole_low <= 1.7 * (high - low)).all():
            low, high = np.minimum(low, whole_low), np.maximum(high, whole_high)
    lacks = np.max(high - low) / 3.0 - (high - low)
    grow = np.maximum(lacks, 0.0) / 2.0
    return low - grow, high + grow


def _regions(post: Postmortem) -> list[ChangedRegion]:
    changes = None if post.hindsight is None else post.hindsight.changes
    return [] if changes is None else list(changes.regions)


def _draw_paths(axes: Axes, post: Postmortem, alone: se2.Array | None) -> list[object]:
    if alone is not None:
        xy = canvas.strided(alone)
        axes.plot(xy[:, 0], xy[:, 1], color=FAINT, linewidth=1.8)
        return [Line2D([], [], color=FAINT, linewidth=1.8, label="odometry alone")]
    handles: list[object] = []
    styles: tuple[tuple[str, str, Literal["-", "--"], float, str], ...] = (
        ("hindsight", BLUE, "-", 2.4, "where it really was"),
        ("belief", VERMILLION, "--", 1.8, "where it believed to be"),
    )
    for name, colour, style, width, label in styles:
        path = _path(post, name)
        if path is None:
            continue
        xy = canvas.strided(path)
        axes.plot(xy[:, 0], xy[:, 1], color=colour, linewidth=width, linestyle=style, zorder=4)
        handles.append(Line2D([], [], color=colour, linewidth=width, linestyle=style, label=label))
        known = xy[np.isfinite(xy).all(axis=1)]
        axes.plot(*known[0, :2], "o", color="white", markeredgecolor=colour, ms=6, zorder=6)
        axes.plot(*known[-1, :2], "s", color=colour, ms=5, zorder=6)
    handles.append(Line2D([], [], color=FAINT, marker="o", mfc="white", ls="", label="start"))
    handles.append(Line2D([], [], color=FAINT, marker="s", ls="", label="end"))
    return handles


def _draw_parting(axes: Axes, post: Postmortem, size: float) -> list[object]:
    """Links from belief to hindsight where they are too far apart, and the widest one named."""
    error = post.error
    if error is None or post.belief is None or not np.isfinite(error.distance_m).any():
        return []
    distance = np.where(np.isfinite(error.distance_m), error.distance_m, 0.0)
    apart = np.flatnonzero(distance > post.limits.position_m)
    if not len(apart):
        return []
    for row in canvas.strided(apart, most=40):
        ends = np.array([post.belief.xyyaw[row, :2], error.where.xyyaw[row, :2]])
        axes.plot(ends[:, 0], ends[:, 1], color=INK, linewidth=0.7, alpha=0.55, zorder=3)
    worst = int(np.argmax(distance))
    ends = np.array([post.belief.xyyaw[worst, :2], error.where.xyyaw[worst, :2]])
    axes.plot(ends[:, 0], ends[:, 1], color=INK, linewidth=1.6, zorder=5)
    at_s = post.seconds(error.t_ns[worst])
    axes.annotate(
        f"{distance[worst]:.1f} m apart\nat {at_s:.0f} s",
        tuple(ends.mean(axis=0)),
        xytext=(8, 8),
        textcoords="offset points",
        fontsize=size,
        fontweight="bold",
        color=INK,
        zorder=8,
        bbox={"boxstyle": "round,pad=0.25", "fc": "white", "ec": INK, "lw": 0.6, "alpha": 0.92},
    )
    return [Line2D([], [], color=INK, linewidth=1.0, label="same moment, apart")]


def _draw_stops(axes: Axes, post: Postmortem, size: float) -> list[object]:
    drawn = False
    for number, stop in enumerate(post.judgement.stops, start=1):
        if stop.x_m is None or stop.y_m is None or number > 30:
            continue
        axes.plot(stop.x_m, stop.y_m, "o", ms=size + 3, color=INK, mec="white", zorder=7)
        axes.annotate(
            str(number),
            (stop.x_m, stop.y_m),
            ha="center",
            va="center_baseline",
            color="white",
            fontsize=size - 2,
            zorder=8,
        )
        drawn = True
    return [Line2D([], [], color=INK, marker="o", ls="", label="unplanned stop")] if drawn else []


def _draw_regions(axes: Axes, post: Postmortem, size: float) -> None:
    for number, region in enumerate(_regions(post), start=1):
        x0, y0, x1, y1 = region.bbox_m
        box = Rectangle(
            (x0 - 0.1, y0 - 0.1),
            x1 - x0 + 0.2,
            y1 - y0 + 0.2,
            fill=False,
            edgecolor=INK,
            linewidth=1.0,
            linestyle=(0, (1, 1.5)),
            zorder=5,
        )
        axes.add_patch(box)
        if region.from_bbox_m is not None:
            old = np.reshape(region.from_bbox_m, (2, 2)).mean(axis=0)
            new = np.array([x0 + x1, y0 + y1]) / 2.0
            axes.annotate(
                "",
                (new[0], new[1]),
                (old[0], old[1]),
                arrowprops={"arrowstyle": "->", "color": INK, "linewidth": 1.0},
                zorder=5,
            )
        if number <= NAMED:
            axes.annotate(
                f"R{number}",
                (x1 + 0.1, y1 + 0.1),
                fontsize=size - 1,
                fontweight="bold",
                color=INK,
                zorder=7,
                bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": INK, "lw": 0.6},
            )
