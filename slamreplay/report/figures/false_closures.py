"""False loop closures on the floor plan, and over the score that a closure needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from slamreplay.geometry.se2 import Array
from slamreplay.report.figures import canvas
from slamreplay.report.figures.canvas import BLUE, FAINT, INK, SKY, VERMILLION

_SIZE = 9.5
#: By the score alone and checked, each without and with the kernel.
_COLOURS = (VERMILLION, VERMILLION, BLUE, BLUE)
_LINES = ("-", (0, (4, 2)), "-", (0, (4, 2)))


@dataclass(frozen=True, eq=False)
class Curve:
    """One way of closing loops: false closures a log, and the largest error (low, median, high)."""

    name: str
    false: Sequence[float]
    error_m: Sequence[tuple[float, float, float]]


@dataclass(frozen=True, eq=False)
class Panel:
    """One corridor: outlines (K, 2), false closures (F, 2) from and to, and the curves."""

    name: str
    solids: Sequence[Sequence[tuple[float, float]]]
    false_from: Array
    false_to: Array
    curves: Sequence[Curve]


def false_closures_figure(
    panels: Sequence[Panel], scores: Sequence[float], textbook: float
) -> Figure:
    """A column for each corridor: plan, false closures, error.

    Args:
        panels: the corridors.
        scores: what a closure needs, ascending.
        textbook: the score that is said to be enough; that of the plan.
    """
    figure = canvas.new_figure(canvas.WIDE, 9.0)
    grid = figure.add_gridspec(3, len(panels), height_ratios=[2.9, 2.6, 3.0])
    for k, panel in enumerate(panels):
        plan, count, error = (figure.add_subplot(grid[row, k]) for row in range(3))
        _plan(plan, panel, textbook)
        canvas.dress(count, "", "false closures a log" if k == 0 else "", _SIZE)
        canvas.dress(error, "min_score", "largest error on the way [m]" if k == 0 else "", _SIZE)
        for curve, colour, line in zip(panel.curves, _COLOURS, _LINES, strict=True):
            low, middle, high = np.array(curve.error_m).T
            count.plot(scores, curve.false, color=colour, lw=1.5, ls=line, marker="o", ms=3.5)
            error.fill_between(scores, low, high, color=colour, alpha=0.12, lw=0.0)
            error.plot(scores, middle, color=colour, lw=1.5, ls=line, marker="o", ms=3.5)
        error.set_yscale("log")
        for axes in (count, error):
            axes.axvline(textbook, color=INK, lw=0.9, ls=":")
            axes.set_xlim(min(scores) - 0.02, max(scores) + 0.02)
        count.set_ylim(bottom=-0.2)
    canvas.legend(figure, _handles(panels[0].curves, textbook), _SIZE, 3)
    return figure


def _plan(axes: Axes, panel: Panel, textbook: float) -> None:
    canvas.dress(axes, "x [m]", "y [m]", _SIZE)
    axes.grid(visible=False)
    axes.add_collection(PolyCollection([*map(np.array, panel.solids)], facecolor=FAINT, lw=0.0))
    ends = np.stack([panel.false_from, panel.false_to], axis=1)
    axes.add_collection(LineCollection([*ends], colors=VERMILLION, lw=1.1, alpha=0.8, zorder=4))
    axes.plot(*panel.false_from.T, "o", color=SKY, ms=3.5, zorder=5)
    axes.plot(*panel.false_to.T, "o", color=VERMILLION, mfc="white", mew=0.9, ms=4, zorder=6)
    axes.set_aspect("equal")
    axes.autoscale_view()
    title = f"{panel.name}: false at {textbook:g} by the score alone, all logs"
    axes.set_title(title, loc="left", fontsize=_SIZE + 0.5, color=INK, weight="bold")


def _handles(curves: Sequence[Curve], textbook: float) -> list[object]:
    return [
        *(
            Line2D([], [], color=colour, ls=line, lw=1.5, marker="o", ms=3.5, label=curve.name)
            for curve, colour, line in zip(curves, _COLOURS, _LINES, strict=True)
        ),
        Line2D([], [], color=INK, ls=":", lw=0.9, label=f"the textbook's {textbook:g}"),
        Line2D([], [], color=VERMILLION, marker="o", mfc=SKY, mec=SKY, ms=4, lw=1.1,
               label="where the robot was (blue) and was put (ring)"),
    ]  # fmt: skip
