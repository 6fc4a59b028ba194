"""What localizers believed over many logs, each a strip, and one of them on the floor plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from slamreplay.geometry.se2 import Array
from slamreplay.report.figures import canvas
from slamreplay.report.figures.canvas import FAINT, GREEN, INK, ORANGE, SKY, VERMILLION

_SIZE = 9.5
#: Wide and wrong, wide and right, tight and wrong, tight and right: 2 tight + right.
_COLOURS = (ORANGE, SKY, VERMILLION, GREEN)
_NAMES = (
    "unsure, the mean is wrong",
    "unsure, the mean is right",
    "collapsed: tight and wrong",
    "credible: tight and right",
)


@dataclass(frozen=True, eq=False)
class Strip:
    """One run of one log.

    Attributes:
        t_s: (N,) times of its rows.
        tight: (N,) what the robot can know.
        right: (N,) what only the truth can say.
        credible_s: from when on both held, None: never.
        motions: when each was begun, and whether the gate let it.
    """

    t_s: Array
    tight: NDArray[np.bool_]
    right: NDArray[np.bool_]
    credible_s: float | None
    motions: Sequence[tuple[float, bool]]


@dataclass(frozen=True, eq=False)
class Way:
    """Outlines of a hall (K, 2) each, and poses (N, 3) in it: true, believed, and how well."""

    solids: Sequence[Sequence[tuple[float, float]]]
    true_xyyaw: Array
    xyyaw: Array
    tight: NDArray[np.bool_]
    right: NDArray[np.bool_]


def two_run_figure(
    runs: Mapping[str, Sequence[Strip]], way: Way, told_apart_s: tuple[float, float]
) -> Figure:
    """The floor plan above, below it a panel for each run with a strip for each log.

    Args:
        runs: strips by the name of the run.
        way: what the floor plan shows.
        told_apart_s: when the robots came to where the two places differ, first and last.
    """
    logs = max(len(strips) for strips in runs.values())
    each = 0.9 + 0.13 * logs
    figure = canvas.new_figure(canvas.WIDE, 4.2 + each * len(runs))
    ratios = [3.6, *[each] * len(runs)]
    plan, *panels = figure.subplots(1 + len(runs), 1, height_ratios=ratios)
    _plan(plan, way)
    end_s = max(float(strip.t_s[-1]) for strips in runs.values() for strip in strips)
    for axes, (name, strips) in zip(panels, runs.items(), strict=True):
        last = axes is panels[-1]
        canvas.dress(axes, "time since start [s]" if last else "", "log", _SIZE)
        axes.grid(visible=False)
        axes.set_title(name, loc="left", fontsize=_SIZE + 1, color=INK, weight="bold")
        axes.set_xlim(0.0, end_s)
        _strips(axes, strips)
        axes.axvspan(*told_apart_s, facecolor="none", edgecolor=INK, hatch="///", lw=0.0, alpha=0.3)
    canvas.legend(figure, _handles(), _SIZE, 4)
    return figure


def _plan(axes: Axes, way: Way) -> None:
    canvas.dress(axes, "x [m]", "y [m]", _SIZE)
    axes.grid(visible=False)
    axes.add_collection(PolyCollection([*map(np.array, way.solids)], facecolor=FAINT, lw=0.0))
    axes.plot(*way.true_xyyaw[:, :2].T, color=INK, lw=1.2, ls="--", zorder=4)
    rows = canvas.strided(np.arange(len(way.xyyaw)), 250)
    state = 2 * way.tight[rows].astype(int) + way.right[rows]
    colours = [_COLOURS[s] for s in state]
    x, y = way.xyyaw[rows, :2].T
    axes.scatter(x, y, c=colours, s=16, lw=0.0, zorder=3)
    axes.set_aspect("equal")
    title = "The log in which the wrong place was held the longest before it was found out"
    axes.set_title(title, loc="left", fontsize=_SIZE + 1, color=INK, weight="bold")


def _strips(axes: Axes, strips: Sequence[Strip]) -> None:
    colours = ListedColormap(_COLOURS)
    for k, strip in enumerate(strips):
        state = 2 * strip.tight.astype(int) + strip.right
        edges = np.append(strip.t_s, strip.t_s[-1] + 0.1)
        axes.pcolormesh(edges, [k - 0.4, k + 0.4], state[None], cmap=colours, vmin=0, vmax=3,
                        rasterized=True)  # fmt: skip
        for t_s, allowed in strip.motions:
            axes.plot(t_s, k, marker="|" if allowed else "x", color=INK, ms=4, mew=0.9, zorder=4)
    axes.set_ylim(len(strips) - 0.4, -0.6)
    axes.set_yticks([0, len(strips) - 1], ["1", str(len(strips))])


def _handles() -> list[object]:
    return [
        *(Patch(color=c, label=n) for c, n in zip(_COLOURS, _NAMES, strict=True)),
        Line2D([], [], color=INK, marker="x", ls="", ms=5, label="motion, blocked by the gate"),
        Line2D([], [], color=INK, marker="|", ls="", ms=7, label="motion, allowed"),
        Line2D([], [], color=INK, ls="--", lw=1.2, label="where the robot was"),
        Patch(facecolor="none", edgecolor=INK, hatch="///", lw=0.0, alpha=0.3,
              label="the robots leave the bay"),
    ]  # fmt: skip
