"""Errors and claims of an estimator that was told too little noise, and who finds it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from slamreplay.geometry.se2 import Array
from slamreplay.report.figures import canvas
from slamreplay.report.figures.canvas import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
)

_SIZE = 9.5
_LOOKS = ((GREEN, "o"), (ORANGE, "s"), (SKY, "^"), (FAINT, "x"), (PURPLE, "D"), (INK, "v"))


@dataclass(frozen=True)
class Course:
    """All logs of one setting: times, errors and claims (N,) of each, and when it was found."""

    title: str
    runs: Sequence[tuple[Array, Array, Array]]
    found_s: Sequence[float]


@dataclass(frozen=True)
class Found:
    """By scale of Q, the share of logs in which a check finds it."""

    title: str
    rows: Sequence[tuple[float, float]]


def collapse_figure(
    courses: Sequence[Course],
    lines: Sequence[Found],
    gate: Sequence[tuple[float, tuple[float, float]]],
) -> Figure:
    """Courses above, below them who finds it and what the gate lets pass.

    Args:
        courses: two settings.
        lines: one for each interval of references.
        gate: by scale of Q, the shares of motions allowed, and allowed in vain.
    """
    figure = canvas.new_figure(canvas.WIDE, 7.2)
    above, below = figure.subplots(2, 2)
    top = max(float(e.max()) for c in courses for _, e, s in c.runs)
    widest = max(float(s.max()) for c in courses for _, _, s in c.runs)
    for axes, course in zip(above, courses, strict=False):
        _course(axes, course, 1.08 * max(top, widest))
    for axes in above[len(courses) :]:
        axes.set_axis_off()
    found, planner = below
    canvas.dress(found, "process noise told, over the true one", "logs in which it is found [%]",
                 _SIZE)  # fmt: skip
    for (colour, shape), line in zip(_LOOKS, lines, strict=False):
        found.plot([s for s, _ in line.rows], [100.0 * v for _, v in line.rows], color=colour,
                   marker=shape, lw=1.8, ms=6, label=line.title)  # fmt: skip
    found.set_title("Who finds the collapse", loc="left", fontsize=_SIZE + 1, color=INK,
                    weight="bold")  # fmt: skip
    canvas.dress(planner, "process noise told, over the true one", "motions [%]", _SIZE)
    scales = [s for s, _ in gate]
    planner.plot(scales, [100.0 * v[0] for _, v in gate], color=BLUE, marker="o", lw=1.8, ms=6,
                 label="the gate allows")  # fmt: skip
    planner.plot(scales, [100.0 * v[1] for _, v in gate], color=VERMILLION, marker="X", lw=1.8,
                 ms=7, label="allowed, and the error is larger than the room")  # fmt: skip
    planner.set_title("What the planner is let do", loc="left", fontsize=_SIZE + 1, color=INK,
                      weight="bold")  # fmt: skip
    for axes in below:
        axes.set_xscale("log")
        axes.invert_xaxis()
        axes.set_xticks(scales, [f"{s:g}" for s in scales])
        axes.minorticks_off()
        axes.set_ylim(-4.0, 118.0)
        axes.set_yticks(range(0, 101, 20))
        axes.legend(fontsize=_SIZE - 0.5, frameon=False, labelcolor=INK, loc="upper left")
    canvas.legend(figure, _handles(), _SIZE, 3)
    return figure


def _course(axes: Axes, course: Course, top: float) -> None:
    canvas.dress(axes, "time since start [s]", "position [m]", _SIZE)
    t_s, _, sigma = course.runs[0]
    axes.fill_between(t_s, 0.0, 3.0 * sigma, color=BLUE, alpha=0.13, lw=0.0, zorder=1)
    for t_s, error, sigma in course.runs:
        axes.plot(t_s, sigma, color=BLUE, lw=1.2, zorder=3)
        axes.plot(t_s, error, color=VERMILLION, lw=1.2, zorder=4)
    for at in course.found_s:
        axes.axvline(at, color=GREEN, lw=1.2, zorder=2)
    axes.set_xlim(0.0, float(course.runs[0][0][-1]))
    axes.set_ylim(0.0, top)
    axes.set_title(course.title, loc="left", fontsize=_SIZE + 1, color=INK, weight="bold")


def _handles() -> list[object]:
    return [
        Line2D([], [], color=VERMILLION, lw=1.6, label="true error, each log"),
        Line2D(
            [],
            [],
            color=BLUE,
            lw=1.6,
            label="sigma claimed, each log (band: three sigma of the first)",
        ),
        Line2D([], [], color=GREEN, lw=1.6, label="a collapse is found from here on"),
    ]
