"""Ellipses along a corridor before and after a loop closure, and a claim beside the true error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse, Patch

from slamreplay.geometry.se2 import Array
from slamreplay.report.figures import canvas
from slamreplay.report.figures.canvas import BLUE, FAINT, INK, ORANGE, VERMILLION

_SIGMAS, _BAND = 2.0, 3.0
#: Every so many poses get an ellipse, and every so many an error: more would hide one another.
_ELLIPSES, _ERRORS = 8, 20
#: Inches: a row of panels, and the claims below them.
_ROW, _CLAIMS = 2.75, 3.6
_SIZE = 9.0


@dataclass(frozen=True, eq=False)
class Belief:
    """What was believed along the corridor.

    Attributes:
        estimate: (N, 2) of one run, along and across the corridor, m.
        P: (N, 2, 2) claimed covariances, m2.
        rms: (N, 2) true error along and across, over many runs, m.
    """

    estimate: Array
    P: Array
    rms: Array

    def sigma(self) -> Array:
        """(N,) claimed along the corridor, m."""
        return np.sqrt(self.P[:, 0, 0])


@dataclass(frozen=True, eq=False)
class Panel:
    """The beliefs of one filter, on the way and looking back after the closure; in a word."""

    before: Belief
    after: Belief
    note: str


@dataclass(frozen=True, eq=False)
class Claim:
    """What a filter claims along the corridor, and how far off it is.

    Attributes:
        note: the numbers of the panel, in a line or two.
        sigma: (N,) claimed, m.
        errors: (M, N) of single runs, m.
        rms: (N,) over all runs, m.
    """

    note: str
    sigma: Array
    errors: Array
    rms: Array


def breathing_figure(
    truth: Array,
    width_m: float,
    rows: Sequence[str],
    columns: Sequence[str],
    panels: Sequence[Sequence[Panel]],
    heading: str,
    claims: Sequence[Claim],
) -> Figure:
    """Rows of updates by columns of process noise, and below them claims side by side.

    Args:
        truth: (N, 2) where the robot was, m.
        width_m: of the corridor.
        rows: what each row is called.
        columns: what each column is called.
        panels: by row and column.
        heading: over the claims.
        claims: drawn side by side on one scale.
    """
    figure = canvas.new_figure(canvas.WIDE, _ROW * len(rows) + _CLAIMS + 0.8)
    grid, below = figure.subfigures(  # type: ignore[misc]
        2, 1, height_ratios=[_ROW * len(rows) + 0.8, _CLAIMS], hspace=0.03
    )
    cells: Any = grid.subplots(
        2 * len(rows), len(columns), sharex=True, squeeze=False, height_ratios=[1.25, 1] * len(rows)
    )
    reach = max(2.2 * width_m / 2, *(_reach(p) for row in panels for p in row))
    for c, noise in enumerate(columns):
        highest = max(float(row[c].before.sigma().max()) for row in panels)
        for r, row in enumerate(panels):
            corridor, error = cells[2 * r][c], cells[2 * r + 1][c]
            _draw_ellipses(corridor, truth, width_m, row[c])
            corridor.set_ylim(-reach, reach)
            # The empty lines are where the names of columns and rows go.
            room = "\n" * (4 if r == 0 else 2)
            corridor.set_title(f"{room}{row[c].note}", fontsize=_SIZE, color=INK, loc="left", pad=3)
            _draw_errors(error, truth[:, 0], row[c])
            error.set_ylim(0.0, 1.15 * highest)
            if c == 0:
                corridor.set_ylabel("across [m]", fontsize=_SIZE, color=INK)
                error.set_ylabel("sigma, error\nalong [m]", fontsize=_SIZE, color=INK)
                _heading(corridor, rows[r], 0.0, 31, _SIZE + 1.5, "left")
        _heading(cells[0][c], noise, 0.5, 54, _SIZE + 1.5, "center")
        cells[-1][c].set_xlabel("driven along the corridor [m]", fontsize=_SIZE, color=INK)
    _legend(grid, _panel_handles())
    beneath: Any = below.subplots(1, len(claims), sharey=True)
    for axes, claim in zip(beneath, claims, strict=True):
        _draw_claim(axes, truth[:, 0], claim)
    _heading(beneath[0], heading, 0.0, 36, _SIZE + 1.5, "left")
    _legend(below, _claim_handles())
    return figure


def _reach(panel: Panel) -> float:
    """Half the height that the last ellipse needs, m."""
    return 1.25 * _SIGMAS * float(np.sqrt(panel.before.P[-1, 1, 1]))


def _heading(axes: Axes, text: str, x: float, up_pt: float, size: float, ha: str) -> None:
    """Text above an axes that moves nothing."""
    label = axes.annotate(
        text, (x, 1.0), (0, up_pt), xycoords="axes fraction", textcoords="offset points",
        ha=ha, fontsize=size, color=INK, weight="bold",
    )  # fmt: skip
    label.set_in_layout(False)


def _draw_ellipses(axes: Axes, truth: Array, width_m: float, panel: Panel) -> None:
    canvas.dress(axes, "", "", _SIZE)
    axes.grid(visible=False)
    length = float(truth[-1, 0])
    axes.set_xlim(-0.13 * length, 1.38 * length)
    half = width_m / 2
    for side in (-half, half):
        axes.plot([-0.03 * length, 1.03 * length], [side, side], color=INK, lw=1.8, zorder=6)
    axes.plot(truth[:, 0], truth[:, 1], color=FAINT, lw=1.0, ls=(0, (2, 2)), zorder=3)
    chosen = np.linspace(0, len(truth) - 1, _ELLIPSES + 1).round().astype(int)
    for belief, colour, fill, zorder in (
        (panel.before, ORANGE, 0.10, 4),
        (panel.after, BLUE, 0.22, 5),
    ):
        for k in chosen:
            axes.add_patch(_ellipse(belief.estimate[k], belief.P[k], colour, fill, zorder))


def _ellipse(xy: Array, P: Array, colour: str, fill: float, zorder: int) -> Ellipse:
    values, vectors = np.linalg.eigh(P)
    return Ellipse(
        (float(xy[0]), float(xy[1])),
        2.0 * _SIGMAS * float(np.sqrt(values[1])),
        2.0 * _SIGMAS * float(np.sqrt(values[0])),
        angle=float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))),
        facecolor=to_rgba(colour, fill),
        edgecolor=to_rgba(colour, 0.95),
        linewidth=1.0,
        zorder=zorder,
    )


def _draw_errors(axes: Axes, along: Array, panel: Panel) -> None:
    canvas.dress(axes, "", "", _SIZE)
    some = slice(None, None, max(1, len(along) // _ERRORS))
    for belief, colour, marker, fill, zorder in (
        (panel.before, ORANGE, "o", 0.30, 2),
        (panel.after, BLUE, "s", 0.45, 4),
    ):
        sigma = belief.sigma()
        axes.fill_between(along, 0.0, sigma, color="white", lw=0, zorder=zorder)
        axes.fill_between(along, 0.0, sigma, color=colour, alpha=fill, lw=0, zorder=zorder)
        axes.plot(along, sigma, color=colour, lw=1.0, zorder=zorder)
        axes.plot(along[some], belief.rms[some, 0], color=INK, marker=marker, ms=3.0, lw=0.0,
                  mfc="white", mew=0.8, zorder=zorder + 1, clip_on=False)  # fmt: skip


def _draw_claim(axes: Axes, along: Array, claim: Claim) -> None:
    canvas.dress(axes, "driven along the corridor [m]", "error along the corridor [m]", _SIZE)
    axes.set_title(f"\n\n{claim.note}", fontsize=_SIZE, color=INK, loc="left", pad=5)
    band = _BAND * claim.sigma
    axes.fill_between(along, -band, band, color=ORANGE, alpha=0.45, lw=0, zorder=2)
    axes.plot(along, claim.errors.T, color=FAINT, lw=0.6, alpha=0.6, zorder=3)
    for sign in (-1.0, 1.0):
        axes.plot(along, sign * claim.rms, color=VERMILLION, lw=1.8, zorder=4)


def _panel_handles() -> list[object]:
    drawn = f"{_SIGMAS:g}-sigma ellipse, and sigma along"
    return [
        Patch(fc=to_rgba(ORANGE, 0.3), ec=ORANGE, label=f"{drawn}: on the way"),
        Patch(fc=to_rgba(BLUE, 0.45), ec=BLUE, label=f"{drawn}: after the closure"),
        Line2D(
            [], [], color=INK, marker="o", ls="", mfc="white", label="true error (rms): on the way"
        ),
        Line2D(
            [],
            [],
            color=INK,
            marker="s",
            ls="",
            mfc="white",
            label="true error (rms): after the closure",
        ),
        Line2D([], [], color=FAINT, ls=(0, (2, 2)), lw=1.0, label="true path"),
        Line2D([], [], color=INK, lw=1.8, label="side walls"),
    ]


def _claim_handles() -> list[object]:
    return [
        Patch(color=ORANGE, alpha=0.45, label=f"{_BAND:g} sigma, as the filter claims"),
        Line2D([], [], color=FAINT, lw=0.8, label="single runs"),
        Line2D([], [], color=VERMILLION, lw=1.8, label="true error, rms of all runs"),
    ]


def _legend(figure: SubFigure, handles: list[object]) -> None:
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=_SIZE,
                  frameon=False, labelcolor=INK, handlelength=1.8, columnspacing=1.8)  # fmt: skip
