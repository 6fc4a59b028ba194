"""Ages of poses against budgets, and what the gate allows behind one more stage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from slamreplay.geometry.se2 import Array
from slamreplay.report.figures import canvas
from slamreplay.report.figures.canvas import BLUE, FAINT, GREEN, INK, ORANGE, VERMILLION

_SIZE = 9.5
_COLOURS = {"controller": VERMILLION, "planner": BLUE}
#: Ages below this are drawn at it: the axis is logarithmic.
_LEAST_MS = 1.0


@dataclass(frozen=True, eq=False)
class AgeCurve:
    """One consumer.

    Attributes:
        label: what the legend calls it.
        name: controller or planner, by which it has its colour.
        is_recorded: drawn bold if it is.
        pose_s: (N,) ages of the pose.
        correction_s: (N,) ages of the correction, NaN without any.
    """

    label: str
    name: str
    is_recorded: bool
    pose_s: Array
    correction_s: Array


@dataclass(frozen=True, eq=False)
class GateLines:
    """The gate.

    Attributes:
        stage_s: (K,) lengths of an added stage.
        held: (K,) share of the moments that are allowed where a correction is used as it is,
        carried: (K,) and where odometry carries it.
        alone: share if no pose were old.
        still: part of that from which on too few are left.
    """

    stage_s: Array
    held: Array
    carried: Array
    alone: float
    still: float


def latency_budget_figure(
    curves: Sequence[AgeCurve],
    budgets_s: Mapping[str, float],
    gate: GateLines | None,
    stages: Sequence[tuple[str, float]],
) -> Figure:
    """Cumulative ages on the left, the gate's share on the right.

    Args:
        curves: the consumers.
        budgets_s: how old the pose of each may be.
        gate: None where it was not asked.
        stages: name and length in s of the stages that the recipe names.
    """
    figure = canvas.new_figure(canvas.WIDE, 4.6)
    if gate is None:
        _ages(figure.subplots(), curves, budgets_s)
        canvas.legend(figure, _handles(curves), _SIZE, 3)
        return figure
    left, right = figure.subplots(1, 2)
    _ages(left, curves, budgets_s)
    _gate(right, gate, stages)
    canvas.legend(figure, [*_handles(curves), *_gate_handles(gate.still)], _SIZE, 3)
    return figure


def _ages(axes: Axes, curves: Sequence[AgeCurve], budgets_s: Mapping[str, float]) -> None:
    canvas.dress(axes, "age when it was used [ms]", "share of the uses [1]", _SIZE)
    axes.set_xscale("log")
    for curve in curves:
        width = 2.0 if curve.is_recorded else 1.1
        for ages, style in ((curve.pose_s, "-"), (curve.correction_s, (0, (4, 2)))):
            ms = np.sort(np.maximum(1e3 * ages[np.isfinite(ages)], _LEAST_MS))
            if len(ms):
                axes.step(ms, np.arange(1, len(ms) + 1) / len(ms), where="post",
                          color=_COLOURS[curve.name], lw=width, ls=style,
                          zorder=4 if curve.is_recorded else 3)  # fmt: skip
    for name, budget_s in budgets_s.items():
        up = name == "planner"
        axes.axvline(1e3 * budget_s, color=_COLOURS[name], lw=1.0, ls=":", zorder=2)
        axes.annotate(f"{name}: {1e3 * budget_s:.0f} ms", (1e3 * budget_s, 1.02),
                      xycoords=("data", "axes fraction"), fontsize=_SIZE - 1,
                      color=_COLOURS[name], ha="left" if up else "right")  # fmt: skip
    axes.set_ylim(0.0, 1.0)
    every = [a[np.isfinite(a)] for c in curves for a in (c.pose_s, c.correction_s)]
    most = max([1.5e3 * float(a.max()) for a in every if len(a)], default=0.0)
    ticks = [1, 10, 100, 1000, 10_000]
    axes.set_xticks(ticks, [f"{tick}" for tick in ticks])
    axes.set_xlim(_LEAST_MS, max(most, 1000.0))


def _gate(axes: Axes, gate: GateLines, stages: Sequence[tuple[str, float]]) -> None:
    length_ms = 1e3 * gate.stage_s
    canvas.dress(axes, "added stage [ms]", "share of moments the gate allows [1]", _SIZE)
    axes.plot(length_ms, gate.held, color=ORANGE, lw=2.0, zorder=4)
    axes.plot(length_ms, gate.carried, color=GREEN, lw=2.0, zorder=5)
    axes.axhline(gate.alone, color=INK, lw=1.0, zorder=3)
    axes.axhline(gate.still * gate.alone, color=INK, lw=1.0, ls=":", zorder=3)
    for k, (name, length) in enumerate(stages):
        axes.axvline(1e3 * length, color=FAINT, lw=0.8, zorder=2)
        axes.annotate(name, (1e3 * length, 0.03 + 0.06 * (k % 3)), xytext=(3, 0),
                      xycoords=("data", "axes fraction"), textcoords="offset points",
                      fontsize=_SIZE - 1, color=FAINT)  # fmt: skip
    axes.set_ylim(0.0, 1.0)
    axes.set_xlim(0.0, float(length_ms[-1]))


def _handles(curves: Sequence[AgeCurve]) -> list[object]:
    return [
        *(Line2D([], [], color=_COLOURS[c.name], lw=2.0 if c.is_recorded else 1.1, label=c.label)
          for c in curves),
        Line2D([], [], color=FAINT, lw=1.4, label="age of the pose"),
        Line2D([], [], color=FAINT, lw=1.4, ls=(0, (4, 2)), label="age of the correction"),
    ]  # fmt: skip


def _gate_handles(still: float) -> list[object]:
    return [
        Line2D([], [], color=ORANGE, lw=2.0, label="correction used as it is"),
        Line2D([], [], color=GREEN, lw=2.0, label="carried by odometry"),
        Line2D([], [], color=INK, lw=1.0, label="by 3 sigma alone"),
        Line2D([], [], color=INK, lw=1.0, ls=":", label=f"{100.0 * still:g} % of that"),
    ]
