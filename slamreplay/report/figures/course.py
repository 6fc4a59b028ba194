"""The course of the log: error, heading and changed beams over one time axis, states behind."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.words import STATES
from slamreplay.report.figures import canvas
from slamreplay.report.figures.canvas import (
    APPEARED,
    BLUE,
    FAINT,
    INK,
    REMOVED,
    STATE_COLOURS,
    Part,
)

#: A letter's width in its height, typically.
_LETTER = 0.62


def course_figure(post: Postmortem, width_in: float) -> Figure | None:
    """Error over time with state bands and the share of changed beams; None without either."""
    parts = course_parts(post)
    if not parts:
        return None
    size = canvas.text_size(width_in)
    row_in = 1.75 if width_in > canvas.COLUMN else 1.3  # a column of a paper is short, too
    figure = canvas.new_figure(width_in, row_in * len(parts) + 0.9)
    every = figure.subplots(len(parts), 1, sharex=True, squeeze=False)[:, 0]
    handles = canvas.draw_parts(parts, every, size)
    canvas.stacked(every)
    canvas.legend(figure, handles, size, columns=2 if width_in < 5.0 else 5)
    return figure


def course_parts(post: Postmortem) -> tuple[Part, ...]:
    """Distance, heading and changed beams over time, as far as they are known."""
    rows: dict[str, Callable[[Axes, Postmortem], str]] = {}
    if post.error is not None:
        rows |= {"error": _distance, "heading": _heading}
    if post.hindsight is not None and post.hindsight.changes is not None:
        rows["changed_beams"] = _changed
    return tuple(Part(name, partial(_draw, post, draw)) for name, draw in rows.items())


def _draw(
    post: Postmortem, curve: Callable[[Axes, Postmortem], str], axes: Axes, size: float
) -> list[object]:
    end_s = float(post.seconds(np.int64(post.manifest.end_ns)))
    canvas.dress(axes, "time since start [s]", curve(axes, post), size)
    axes.set_xlim(0.0, max(end_s, 1e-3))
    axes.locator_params(axis="x", nbins=6)  # times of long logs have many digits
    _bands(axes, post)
    if curve is _distance or post.error is None:
        _name_bands(axes, post, size - 1.5)
    seen = dict.fromkeys(i.state for i in post.judgement.intervals)
    handles: list[object] = [
        Patch(color=STATE_COLOURS[s], alpha=0.35, label=STATES[s].name) for s in seen
    ]
    handles.append(Line2D([], [], color=INK, ls="--", lw=1.0, label="limit"))
    if curve is _changed:
        handles += [
            Patch(facecolor=APPEARED, edgecolor=FAINT, lw=0.6, label="stands there, not mapped"),
            Patch(facecolor=REMOVED, edgecolor=FAINT, lw=0.6, label="mapped, but gone"),
        ]
    if post.judgement.stops:
        handles.append(Line2D([], [], color=INK, ls=":", lw=1.2, label="unplanned stop"))
    return handles


def _bands(axes: Axes, post: Postmortem) -> None:
    for interval in post.judgement.intervals:
        start, end = post.seconds(np.array([interval.start_ns, interval.end_ns]))
        colour = STATE_COLOURS[interval.state]
        alpha = 0.07 if interval.state == "healthy" else 0.22
        axes.axvspan(start, end, color=colour, alpha=alpha, linewidth=0.0, zorder=0)
    for stop in post.judgement.stops:
        at_s = float(post.seconds(np.int64(stop.t_ns)))
        axes.axvline(at_s, color=INK, linestyle=":", linewidth=1.2, zorder=3)


def _name_bands(axes: Axes, post: Postmortem, size: float) -> None:
    """Each state's name on its stretches, where it fits: colours alone do not tell them apart."""
    whole = max(post.manifest.end_ns - post.manifest.start_ns, 1)
    figure = axes.get_figure(root=True)
    assert figure is not None  # of any axes
    wide_in = float(figure.get_figwidth() * axes.get_position().width)
    for interval in post.judgement.intervals:
        name = STATES[interval.state].name
        if interval.duration_ns / whole * wide_in > _LETTER * size / 72.0 * (len(name) + 1):
            middle = post.seconds(np.int64((interval.start_ns + interval.end_ns) // 2))
            axes.text(
                float(middle), 0.98, name, fontsize=size, color=INK, ha="center", va="top",
                transform=axes.get_xaxis_transform(), zorder=5,
            )  # fmt: skip


def _limit(axes: Axes, value: float) -> None:
    axes.axhline(value, color=INK, linestyle="--", linewidth=1.0, zorder=3)


def _curve(axes: Axes, post: Postmortem, values: np.ndarray, limit: float) -> None:
    assert post.error is not None
    t, y = canvas.thinned(post.seconds(post.error.t_ns), values)
    axes.plot(t, y, color=BLUE, linewidth=1.4, zorder=4)
    _limit(axes, limit)
    top = np.nanmax(y) if np.isfinite(y).any() else 0.0
    axes.set_ylim(0.0, 1.25 * max(float(top), limit))


def _distance(axes: Axes, post: Postmortem) -> str:
    assert post.error is not None
    _curve(axes, post, post.error.distance_m, post.limits.position_m)
    return "belief off by [m]"


def _heading(axes: Axes, post: Postmortem) -> str:
    assert post.error is not None
    limit = np.degrees(post.limits.yaw_rad)
    _curve(axes, post, np.degrees(post.error.heading_rad), float(limit))
    return "heading off by [deg]"


def _changed(axes: Axes, post: Postmortem) -> str:
    changes = None if post.hindsight is None else post.hindsight.changes
    assert changes is not None
    t = post.seconds(changes.t_ns)
    appeared = 100.0 * np.nan_to_num(changes.appeared_share)
    total = 100.0 * np.nan_to_num(changes.changed_share)
    _, high = canvas.thinned(t, total)
    keep = np.arange(len(t)) if len(t) <= 1200 else np.linspace(0, len(t) - 1, 1200).astype(int)
    axes.fill_between(t[keep], 0.0, appeared[keep], color=APPEARED, linewidth=0.0, zorder=2)
    axes.fill_between(t[keep], appeared[keep], total[keep], color=REMOVED, linewidth=0.0, zorder=2)
    unknown = ~np.isfinite(changes.changed_share)
    axes.plot(t[unknown], np.zeros(unknown.sum()), "|", color=FAINT, ms=4, zorder=3)
    _limit(axes, 100.0 * post.limits.changed_share)
    axes.set_ylim(0.0, 1.15 * max(float(high.max(initial=0.0)), 100.0 * post.limits.changed_share))
    return "changed beams [%]"
