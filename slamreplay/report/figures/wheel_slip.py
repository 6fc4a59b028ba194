"""Errors and claims of estimators through a wheel slip, over many logs of one drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from slamreplay.geometry.se2 import Array
from slamreplay.report.figures import canvas
from slamreplay.report.figures.canvas import BLUE, FAINT, GREEN, INK, ORANGE, VERMILLION

_SIZE = 9.5


@dataclass(frozen=True, eq=False)
class Panel:
    """One estimator.

    Attributes:
        name: its name.
        t_s: (N,) times of the drives with the slip.
        error_m: (L, N) error of each log.
        sigma_m: (L, N) claim of each log.
        steady_t_s: (M,) times of the drives without it.
        steady_sigma_m: (L, M) their claims.
        closures_s: when closures were taken, in any log.
    """

    name: str
    t_s: Array
    error_m: Array
    sigma_m: Array
    steady_t_s: Array
    steady_sigma_m: Array
    closures_s: Sequence[float]


def wheel_slip_figure(
    panels: Sequence[Panel],
    slip_s: tuple[float, float],
    solids: Sequence[Sequence[tuple[float, float]]],
    xyyaw: Array,
    slips: NDArray[np.bool_],
) -> Figure:
    """The way above, below it a panel for each estimator.

    Args:
        panels: the estimators.
        slip_s: when the slip began and ended.
        solids: outlines (K, 2) of what stands in the hall.
        xyyaw: (N, 3) the true way.
        slips: (N,) where on it the wheels slip.
    """
    figure = canvas.new_figure(canvas.WIDE, 3.0 + 2.2 * len(panels))
    ratios = [3.0, *[2.2] * len(panels)]
    plan, *every = figure.subplots(1 + len(panels), 1, height_ratios=ratios)
    _plan(plan, solids, xyyaw, slips)
    for axes, panel in zip(every, panels, strict=True):
        last = axes is every[-1]
        canvas.dress(axes, "time since start [s]" if last else "", "position [m]", _SIZE)
        axes.axvspan(*slip_s, color=ORANGE, alpha=0.25, lw=0.0, zorder=0)
        for t_s in panel.closures_s:
            axes.axvline(t_s, color=GREEN, lw=0.8, zorder=1)
        axes.plot(panel.steady_t_s, np.median(panel.steady_sigma_m, axis=0), color=BLUE, lw=1.2,
                  ls=(0, (4, 2)), zorder=4)  # fmt: skip
        axes.plot(panel.t_s, panel.sigma_m.T, color=BLUE, lw=0.5, alpha=0.35, zorder=3)
        axes.plot(panel.t_s, np.median(panel.sigma_m, axis=0), color=BLUE, lw=1.8, zorder=5)
        axes.plot(panel.t_s, panel.error_m.T, color=VERMILLION, lw=0.5, alpha=0.35, zorder=3)
        axes.plot(panel.t_s, np.median(panel.error_m, axis=0), color=VERMILLION, lw=1.8, zorder=6)
        axes.set_yscale("log")
        axes.set_ylim(2e-3, 20.0)
        axes.set_yticks([0.01, 0.1, 1.0, 10.0], ["0.01", "0.1", "1", "10"])
        axes.minorticks_off()
        axes.set_xlim(0.0, float(panel.t_s[-1]))
        axes.set_title(panel.name, loc="left", fontsize=_SIZE + 1, color=INK, weight="bold")
    canvas.legend(figure, _handles(), _SIZE, 5)
    return figure


def _plan(
    axes: Axes,
    solids: Sequence[Sequence[tuple[float, float]]],
    xyyaw: Array,
    slips: NDArray[np.bool_],
) -> None:
    canvas.dress(axes, "x [m]", "y [m]", _SIZE)
    axes.grid(visible=False)
    axes.add_collection(PolyCollection([*map(np.array, solids)], facecolor=FAINT, lw=0.0))
    axes.plot(*xyyaw[:, :2].T, color=INK, lw=1.2, zorder=3)
    axes.plot(*xyyaw[slips, :2].T, color=ORANGE, lw=7.0, solid_capstyle="round", zorder=4)
    axes.plot(*xyyaw[0, :2], "o", color=INK, ms=6, zorder=5)
    axes.set_aspect("equal")


def _handles() -> list[object]:
    return [
        Line2D([], [], color=VERMILLION, lw=1.8, label="error, median and each log"),
        Line2D([], [], color=BLUE, lw=1.8, label="sigma claimed, median and each log"),
        Line2D([], [], color=BLUE, lw=1.2, ls=(0, (4, 2)), label="sigma without the slip"),
        Patch(color=ORANGE, alpha=0.4, label="the wheels slip"),
        Line2D([], [], color=GREEN, lw=1.2, label="a loop closure is taken"),
    ]
