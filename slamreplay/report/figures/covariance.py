"""Is the covariance honest: ellipses along the path, claimed against real error, NEES."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse, Patch
from numpy.typing import NDArray

from slamreplay.bundle.track import PoseTrack
from slamreplay.evidence.result import Postmortem
from slamreplay.geometry import se2
from slamreplay.report.figures import canvas
from slamreplay.report.figures.canvas import BLUE, FAINT, INK, ORANGE, SKY, VERMILLION, Part

_SIGMAS = 3.0
_ELLIPSES = 24


def claimed(belief: PoseTrack | None) -> NDArray[np.bool_]:
    """(N,) rows of the belief with a pose and a usable position covariance."""
    if belief is None:
        return np.zeros(0, dtype=bool)
    block = belief.cov[:, :2, :2]
    sound = np.isfinite(block).all(axis=(1, 2)) & belief.has_pose
    sound[sound] = np.linalg.eigvalsh(block[sound])[:, 0] > 0.0
    return np.asarray(sound)


def sigma_position_m(belief: PoseTrack) -> se2.Array:
    """(N,) standard deviation along the worst direction, m; NaN where none is claimed."""
    out = np.full(len(belief), np.nan)
    rows = claimed(belief)
    out[rows] = np.sqrt(np.linalg.eigvalsh(belief.cov[rows, :2, :2])[:, -1])
    return out


def covariance_figure(post: Postmortem, width_in: float) -> Figure | None:
    """Ellipses along the path, claimed against real error, and NEES; None without covariance."""
    parts = covariance_parts(post)
    if not parts:
        return None
    narrow = width_in < 5.0
    size = canvas.text_size(width_in)
    curves = len(parts) - 1
    figure = canvas.new_figure(width_in, (8.6 if curves == 2 else 6.4) if narrow else 5.0)
    if narrow:
        axes = figure.subplots(1 + curves, 1, height_ratios=[1.5] + [1.0] * curves)
        plane, time = axes[0], list(axes[1:])
        for each in time[1:]:
            each.sharex(time[0])
    else:
        left, right = list(figure.subfigures(1, 2, width_ratios=[1.0, 1.35], squeeze=False)[0])
        plane = left.subplots()
        time = list(right.subplots(curves, 1, sharex=True, squeeze=False)[:, 0])
    handles = canvas.draw_parts(parts, [plane, *time], size)
    canvas.stacked(time)
    canvas.legend(figure, handles, size, columns=1 if narrow else 3)
    return figure


def covariance_parts(post: Postmortem) -> tuple[Part, ...]:
    """Ellipses along the path, sigma and NEES over time; nothing without a covariance."""
    belief, rows = post.belief, claimed(post.belief)
    if belief is None or not rows.any():
        return ()
    parts = [
        Part("ellipses", lambda axes, size: _draw_ellipses(axes, post, belief, rows, size)),
        Part("sigma", lambda axes, size: _draw_claim(axes, post, belief, size)),
    ]
    if post.nees is not None and np.isfinite(post.nees.joint).any():
        parts.append(Part("nees", lambda axes, size: _draw_nees(axes, post, size)))
    return tuple(parts)


def _draw_ellipses(
    axes: Axes, post: Postmortem, belief: PoseTrack, rows: NDArray[np.bool_], size: float
) -> list[object]:
    """Equal times apart, so that standing still does not hide the rest."""
    canvas.dress(axes, "x in map [m]", "y in map [m]", size)
    axes.set_aspect("equal", adjustable="datalim")
    handles: list[object] = [
        Patch(
            facecolor=to_rgba(ORANGE, 0.08), edgecolor=ORANGE, label="3-sigma ellipse of the belief"
        ),
        Line2D([], [], color=VERMILLION, lw=1.2, ls=(0, (4, 1.6)), label="believed path"),
    ]
    reference = post.reference
    if reference is not None and reference.has_pose.any():
        xy = canvas.strided(reference.xyyaw)
        axes.plot(xy[:, 0], xy[:, 1], color=BLUE, linewidth=1.4, zorder=2)
        kind = (post.reference_kind or "reference").replace("_", " ")
        handles.append(Line2D([], [], color=BLUE, lw=1.4, label=f"path by {kind}"))
    xy = canvas.strided(belief.xyyaw)
    axes.plot(xy[:, 0], xy[:, 1], color=VERMILLION, lw=1.2, ls=(0, (4, 1.6)), zorder=3)
    known = np.flatnonzero(rows)
    at = np.linspace(belief.t_ns[known[0]], belief.t_ns[known[-1]], _ELLIPSES)
    chosen = sorted({int(np.argmin(np.abs(belief.t_ns[known] - t))) for t in at})
    for row in known[chosen]:
        values, vectors = np.linalg.eigh(belief.cov[row, :2, :2])
        angle = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
        ellipse = Ellipse(
            (belief.xyyaw[row, 0], belief.xyyaw[row, 1]),
            2.0 * _SIGMAS * np.sqrt(values[1]),
            2.0 * _SIGMAS * np.sqrt(values[0]),
            angle=float(angle),
            facecolor=to_rgba(ORANGE, 0.08),
            edgecolor=to_rgba(ORANGE, 0.9),
            linewidth=0.9,
            zorder=4,
        )
        axes.add_patch(ellipse)
    return handles


def _dress_time(axes: Axes, post: Postmortem, y: str, size: float) -> None:
    canvas.dress(axes, "time since start [s]", y, size)
    end_s = float(post.seconds(np.int64(post.manifest.end_ns)))
    axes.set_xlim(0.0, max(end_s, 1e-3))


def _draw_claim(axes: Axes, post: Postmortem, belief: PoseTrack, size: float) -> list[object]:
    _dress_time(axes, post, "position [m]", size)
    t = post.seconds(belief.t_ns)
    s, high = canvas.thinned(t, _SIGMAS * sigma_position_m(belief))
    axes.fill_between(s, 0.0, high, color=ORANGE, alpha=0.35, linewidth=0.0, zorder=2)
    handles: list[object] = []
    if post.reference is not None:
        step = belief.xyyaw - post.reference.at(belief.t_ns).xyyaw
        s, error = canvas.thinned(t, np.hypot(step[:, 0], step[:, 1]))
        axes.plot(s, error, color=BLUE, linewidth=1.4, zorder=4)
        handles.append(Line2D([], [], color=BLUE, lw=1.4, label="how far off it really was"))
    axes.set_ylim(bottom=0.0)
    return [*handles, Patch(color=ORANGE, alpha=0.35, label="3 sigma, as the filter claimed")]


def _draw_nees(axes: Axes, post: Postmortem, size: float) -> list[object]:
    nees = post.nees
    assert nees is not None
    _dress_time(axes, post, "NEES of x, y, yaw [1]", size)
    floor = 1e-2
    summary = nees.summary().test
    s, value = canvas.thinned(post.seconds(nees.t_ns), nees.joint)
    axes.plot(
        s,
        np.maximum(value, floor),
        ".-" if len(s) < 80 else "-",
        color=INK,
        lw=0.8,
        ms=2.5,
        zorder=4,
    )
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylim(floor, max(30.0, 2.0 * float(np.nanmax(value))))
    axes.axhline(summary.dof, color=FAINT, linestyle="--", linewidth=1.0, zorder=3)
    handles: list[object] = [
        Line2D([], [], color=INK, marker=".", lw=0.8, label="NEES"),
        Line2D([], [], color=FAINT, ls="--", lw=1.0, label=f"expected: {summary.dof}"),
    ]
    if summary.low is not None and summary.high is not None:
        low, high = max(summary.low, floor), max(summary.high, floor)
        axes.axhspan(low, high, color=SKY, alpha=0.3, linewidth=0.0, zorder=1)
        handles.append(Patch(color=SKY, alpha=0.3, label="chance would put the mean here (95 %)"))
    if summary.mean is not None:
        axes.axhline(max(summary.mean, floor), color=VERMILLION, linewidth=1.4, zorder=3)
        handles.append(Line2D([], [], color=VERMILLION, lw=1.4, label=f"mean: {summary.mean:.3g}"))
    return handles
