"""Logs of lost robots and of changed aisles: on the axes a robot has, and on those a log has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from slamreplay.report.figures import canvas
from slamreplay.report.figures.canvas import FAINT, INK, ORANGE, STATE_COLOURS, VERMILLION

_SIZE = 9.5
#: State to its mark and its words: shapes, for colours alone are not told apart by everybody.
_MARKS = {
    "healthy": ("o", "healthy"),
    "lost": ("X", "lost"),
    "map_changed": ("s", "map changed"),
    "lost_and_map_changed": ("D", "both"),
}
_ACROSS = 4


@dataclass(frozen=True)
class Mark:
    """One log: its true state, the verdict, and its measures by name."""

    true_state: str
    state: str
    measures: Mapping[str, float]


@dataclass(frozen=True)
class Dose:
    """One difference: a title, and of each log its level, and for how long it was each, s."""

    title: str
    rows: Sequence[tuple[float, float, float]]


def lost_or_changed_figure(
    marks: Sequence[Mark],
    doses: Sequence[Dose],
    areas: Mapping[str, float | None],
    for_s: float,
) -> Figure:
    """Two planes above, below them a small panel for each difference.

    Args:
        marks: the logs.
        doses: the differences.
        areas: by measure, how well it parts lost moments from changed ones.
        for_s: what counts is what lasted so long in all.
    """
    rows = -(-len(doses) // _ACROSS)
    figure = canvas.new_figure(canvas.WIDE, 5.2 + 2.3 * rows)
    parts = figure.subfigures(2, 1, height_ratios=[5.2, 2.3 * rows], squeeze=False)
    above, below = parts[:, 0]
    left, right = above.subplots(1, 2)
    _plane(left, marks, "sigma_m", "beams_off")
    canvas.dress(left, "sigma that the covariance claims [m]",
                 "beams off the map, seen from the belief [%]", _SIZE)  # fmt: skip
    _titled(left, "What the robot knew: lost and changed lie mixed",
            f"AUC lost against changed: sigma {_area(areas['sigma_m'])}, "
            f"beams {_area(areas['beams_off'])}")  # fmt: skip
    left.set_xticks([0.5, 1.0, 2.0, 4.0], ["0.5", "1", "2", "4"])
    _plane(right, marks, "error_m", "changed_share")
    canvas.dress(right, "belief against hindsight [m]",
                 "changed beams, cast from hindsight [%]", _SIZE)  # fmt: skip
    _titled(right, "What the log knows: each lies in its corner",
            f"AUC lost against changed: error {_area(areas['error_m'])}, "
            f"changed beams {_area(areas['changed_share'])}")  # fmt: skip
    right.set_xticks([0.1, 0.2, 0.5, 1.0, 2.0, 5.0], ["0.1", "0.2", "0.5", "1", "2", "5"])
    right.axvline(0.5, color=FAINT, lw=1.0, ls=(0, (4, 3)))
    right.axhline(8.0, color=FAINT, lw=1.0, ls=(0, (4, 3)))
    panels = below.subplots(rows, _ACROSS, squeeze=False)
    for axes, dose in zip(panels.flat, doses, strict=False):
        _dose(axes, dose, for_s)
    for row in panels:
        row[0].set_ylabel("called so for [s]", fontsize=_SIZE, color=INK)
    for axes in panels.flat[len(doses) :]:
        axes.set_axis_off()
    canvas.legend(figure, _handles(for_s), _SIZE, 4)
    return figure


def _plane(axes: Axes, marks: Sequence[Mark], x: str, y: str) -> None:
    for state, (shape, _) in _MARKS.items():
        own = [m for m in marks if m.true_state == state]
        axes.scatter([m.measures[x] for m in own], [100.0 * m.measures[y] for m in own],
                     marker=shape, s=52, color=STATE_COLOURS[state], edgecolors="white", lw=0.7,
                     alpha=0.9, zorder=3)  # fmt: skip
        wrong = [m for m in own if m.state != m.true_state]
        axes.scatter([m.measures[x] for m in wrong], [100.0 * m.measures[y] for m in wrong],
                     marker="o", s=150, facecolors="none", edgecolors=INK, lw=1.0,
                     zorder=4)  # fmt: skip
    axes.set_xscale("log")
    axes.minorticks_off()


def _titled(axes: Axes, title: str, below: str) -> None:
    axes.set_title(f"{title}\n", loc="left", fontsize=_SIZE + 1.5, color=INK, weight="bold")
    axes.text(0.0, 1.02, below, transform=axes.transAxes, fontsize=_SIZE, color=INK)


def _area(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _dose(axes: Axes, dose: Dose, for_s: float) -> None:
    """Seconds over the levels, which stand side by side whatever lies between them."""
    canvas.dress(axes, "", "", _SIZE)
    levels = sorted({row[0] for row in dose.rows})
    at = np.arange(len(levels))
    for column, colour, shape in ((1, VERMILLION, "X"), (2, ORANGE, "s")):
        values = [[r[column] for r in dose.rows if r[0] == level] for level in levels]
        axes.plot(at, [np.median(v) for v in values], color=colour, lw=1.6, zorder=3)
        for k, every in enumerate(values):
            axes.scatter([k] * len(every), every, marker=shape, s=20, color=colour,
                         edgecolors="white", lw=0.4, zorder=4)  # fmt: skip
    axes.axhline(for_s, color=FAINT, lw=1.0, ls=(0, (4, 3)), zorder=2)
    axes.set_xticks(at, [f"{level:g}" for level in levels])
    axes.set_ylim(-2.0, 50.0)
    axes.set_title(dose.title, loc="left", fontsize=_SIZE, color=INK)


def _handles(for_s: float) -> list[object]:
    marks: list[object] = [
        Line2D(
            [], [], marker=shape, ls="", ms=7, color=STATE_COLOURS[state], label=f"in truth {text}"
        )
        for state, (shape, text) in _MARKS.items()
    ]
    return [
        *marks,
        Line2D([], [], marker="o", ls="", ms=11, mfc="none", color=INK, label="verdict is another"),
        Line2D(
            [], [], color=VERMILLION, marker="X", lw=1.6, label="verdict: lost, median and logs"
        ),
        Line2D([], [], color=ORANGE, marker="s", lw=1.6, label="verdict: changed"),
        Line2D([], [], color=FAINT, lw=1.0, ls=(0, (4, 3)), label=f"limits ({for_s:g} s in all)"),
    ]
