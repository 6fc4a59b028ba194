"""Ways of estimating one log side by side, and their errors beside what they claim."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse, Patch

from slamreplay.geometry.se2 import Array
from slamreplay.report.figures import canvas
from slamreplay.report.figures.canvas import BLUE, FAINT, GREEN, INK, ORANGE, VERMILLION

_SIZE = 9.5
_COLOURS = (VERMILLION, ORANGE, BLUE)
_SIGMAS, _ELLIPSES = 3.0, 12


@dataclass(frozen=True, eq=False)
class Plan:
    """One log: poses (K, 3) and landmarks (L, 2), true and estimated, and cov (K, 3, 3)."""

    name: str
    true_xyyaw: Array
    true_landmarks: Array
    xyyaw: Array
    cov: Array
    landmarks: Array


@dataclass(frozen=True, eq=False)
class Curve:
    """Over the way (K - 1,): root mean square error and claim of all logs in m, and mean NEES."""

    error_m: Array
    sigma_m: Array
    nees: Array


def joint_figure(
    plans: Sequence[Plan],
    curves: Mapping[str, Curve],
    way_m: Array,
    honest: tuple[float, float],
) -> Figure:
    """Plans above; below them errors with claims, and NEES with the interval of honest claims.

    Args:
        plans: one for each way.
        curves: by the names of the plans.
        way_m: (K - 1,) driven so far.
        honest: where the mean NEES over all logs lies if claims are true, at one pose.
    """
    figure = canvas.new_figure(canvas.WIDE, 7.4)
    grid = figure.add_gridspec(2, 6, height_ratios=[3.3, 4.0])
    for k, (plan, colour) in enumerate(zip(plans, _COLOURS, strict=True)):
        _plan(figure.add_subplot(grid[0, 2 * k : 2 * k + 2]), plan, colour, is_first=k == 0)
    left, right = figure.add_subplot(grid[1, :3]), figure.add_subplot(grid[1, 3:])
    canvas.dress(left, "way driven [m]", "position, over all logs [m]", _SIZE)
    canvas.dress(right, "way driven [m]", "mean NEES of x, y and yaw [1]", _SIZE)
    right.axhspan(*honest, color=GREEN, alpha=0.25, lw=0.0, zorder=1)
    for (_, curve), colour in zip(curves.items(), _COLOURS, strict=True):
        left.plot(way_m, curve.error_m, color=colour, lw=1.5, zorder=4)
        left.plot(way_m, curve.sigma_m, color=colour, lw=1.2, ls=(0, (4, 2)), zorder=5)
        right.plot(way_m, curve.nees, color=colour, lw=1.5, zorder=4)
    for axes in (left, right):
        axes.set_yscale("log")
        axes.set_xlim(0.0, float(way_m[-1]))
    canvas.legend(figure, _handles(list(curves)), _SIZE, 4)
    return figure


def _plan(axes: Axes, plan: Plan, colour: str, *, is_first: bool) -> None:
    canvas.dress(axes, "x [m]", "y [m]" if is_first else "", _SIZE)
    axes.plot(*plan.true_xyyaw[:, :2].T, color=INK, lw=1.0, ls="--", zorder=3)
    axes.plot(*plan.true_landmarks.T, "o", color=FAINT, ms=6, mfc="none", mew=0.9, zorder=2)
    axes.plot(*plan.xyyaw[:, :2].T, color=colour, lw=1.3, zorder=4)
    axes.plot(*plan.landmarks.T, "+", color=colour, ms=6, mew=1.2, zorder=5)
    for k in np.linspace(1, len(plan.xyyaw) - 1, _ELLIPSES).astype(int):
        values, vectors = np.linalg.eigh(plan.cov[k, :2, :2])
        width, height = 2.0 * _SIGMAS * np.sqrt(values)
        angle = float(np.degrees(np.arctan2(vectors[1, 0], vectors[0, 0])))
        x, y = plan.xyyaw[k, :2].tolist()
        axes.add_patch(
            Ellipse((x, y), width, height, angle=angle, fc="none", ec=colour, lw=1.4, zorder=6)
        )
    axes.set_aspect("equal")
    axes.set_title(plan.name, loc="left", fontsize=_SIZE + 1, color=INK, weight="bold")


def _handles(names: Sequence[str]) -> list[object]:
    return [
        *(Line2D([], [], color=c, lw=1.5, label=n) for c, n in zip(_COLOURS, names, strict=True)),
        Patch(color=GREEN, alpha=0.25, label="95 % interval of an honest claim"),
        Line2D([], [], color=INK, lw=1.5, label="below: error"),
        Line2D([], [], color=INK, lw=1.2, ls=(0, (4, 2)), label="below: sigma claimed"),
        Line2D([], [], color=INK, lw=1.0, ls="--", marker="o", mfc="none", mec=FAINT, ms=6,
               label="above: truth"),
        Line2D([], [], color=INK, marker="+", ls="", ms=6, label="above: landmarks as mapped"),
    ]  # fmt: skip
