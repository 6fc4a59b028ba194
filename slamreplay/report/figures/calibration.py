"""False alarms of an interval over the errors' memory, and what it finds over the size of a lie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from slamreplay.report.figures import canvas
from slamreplay.report.figures.canvas import BLUE, GREEN, INK, ORANGE, PURPLE, RULE, VERMILLION

_SIZE = 9.5
_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, VERMILLION, INK)
_MARKERS = ("o", "s", "^", "D", "v", "x")


@dataclass(frozen=True)
class Curve:
    """Shares by abscissa; `beside` is the other reading of the same logs, drawn dashed."""

    name: str
    x: Sequence[float]
    share: Sequence[float]
    beside: Sequence[float]
    low: Sequence[float] = ()
    high: Sequence[float] = ()


def calibration_figure(
    alarms: Sequence[Curve],
    powers: Sequence[Curve],
    allowed: tuple[float, float],
    nominal: float,
    accuse: float,
    dof: int,
) -> Figure:
    """Two panels side by side.

    Args:
        alarms: by the errors' correlation, `beside` the textbook's interval.
        powers: by how many times too small sigma is told, `beside` at the p-value that accuses.
        allowed: what the false alarms have to stay within.
        nominal: error probability of the intervals.
        accuse: p-value below which a finding is raised.
        dof: degrees of freedom of what is drawn.
    """
    figure = canvas.new_figure(canvas.WIDE, 5.2)
    left, right = figure.subplots(1, 2)
    _alarms(left, alarms, allowed, nominal)
    left.set_title(f"Consistent errors, {dof} degrees of freedom", loc="left", fontsize=_SIZE + 1,
                   color=INK, weight="bold")  # fmt: skip
    _powers(right, powers)
    right.set_title("Sigma told too small", loc="left", fontsize=_SIZE + 1, color=INK,
                    weight="bold")  # fmt: skip
    canvas.legend(figure, _handles(alarms, allowed, nominal, accuse), _SIZE, 3)
    return figure


def _alarms(
    axes: Axes, curves: Sequence[Curve], allowed: tuple[float, float], nominal: float
) -> None:
    across, up = "correlation of one error with the next [1]", "logs outside of the interval [%]"
    canvas.dress(axes, across, up, _SIZE)
    values = sorted({x for curve in curves for x in curve.x})
    places = {x: k for k, x in enumerate(values)}
    axes.axhspan(100 * allowed[0], 100 * allowed[1], color=GREEN, alpha=0.15, lw=0, zorder=1)
    axes.axhline(100 * nominal, color=RULE, lw=1.0, zorder=2)
    for k, curve in enumerate(curves):
        # Side by side, or the bars would lie upon each other.
        x = [places[v] + 0.12 * (k - (len(curves) - 1) / 2) for v in curve.x]
        style: dict[str, Any] = {"color": _COLOURS[k % 6], "marker": _MARKERS[k % 6], "ms": 5}
        drawn = [j for j, share in enumerate(curve.share) if share > 0.0]  # the axis is in logs
        axes.plot(x, [100 * s for s in curve.beside], ls=(0, (4, 2)), lw=1.0, mfc="white", **style)
        axes.plot(
            [x[j] for j in drawn], [100 * curve.share[j] for j in drawn], lw=1.6, zorder=5, **style
        )
        if curve.low:
            low, high = ([100 * v[j] for j in drawn] for v in (curve.low, curve.high))
            axes.vlines([x[j] for j in drawn], low, high, colors=style["color"], lw=1.0, zorder=4)
    axes.set_xticks(list(places.values()), [f"{v:g}" for v in places])
    axes.set_yscale("log")
    axes.set_ylim(1.0, 100.0)
    axes.set_yticks([1, 2, 5, 8, 20, 50, 100], ["1", "2", "5", "8", "20", "50", "100"])
    axes.minorticks_off()


def _powers(axes: Axes, curves: Sequence[Curve]) -> None:
    canvas.dress(axes, "sigma too small by a factor of", "logs in which that is found [%]", _SIZE)
    for k, curve in enumerate(curves):
        style: dict[str, Any] = {"color": _COLOURS[k % 6], "marker": _MARKERS[k % 6], "ms": 5}
        axes.plot(curve.x, [100 * s for s in curve.beside], ls=(0, (1, 1.5)), lw=1.2, mfc="white",
                  **style)  # fmt: skip
        axes.plot(curve.x, [100 * s for s in curve.share], lw=1.6, zorder=5, **style)
    axes.axhline(90.0, color=RULE, lw=1.0, zorder=2)
    axes.set_ylim(0.0, 102.0)
    axes.set_yticks([0, 20, 40, 60, 80, 90, 100])


def _handles(
    curves: Sequence[Curve], allowed: tuple[float, float], nominal: float, accuse: float
) -> list[object]:
    handles: list[object] = [
        Line2D([], [], color=_COLOURS[k % 6], marker=_MARKERS[k % 6], ms=5, lw=1.6, label=c.name)
        for k, c in enumerate(curves)
    ]
    band = f"{100 * allowed[0]:g} to {100 * allowed[1]:g} %, {100 * nominal:g} % is nominal"
    return [
        *handles,
        Line2D([], [], color=INK, marker="o", mfc="white", ms=5, ls=(0, (4, 2)), lw=1.0,
               label="left, dashed: the textbook's interval, every row counted as independent"),
        Line2D([], [], color=INK, marker="o", mfc="white", ms=5, ls=(0, (1, 1.5)), lw=1.2,
               label=f"right, dotted: with p < {accuse:g}, as a finding needs"),
        Patch(color=GREEN, alpha=0.15, label=f"left, band: {band}"),
    ]  # fmt: skip
