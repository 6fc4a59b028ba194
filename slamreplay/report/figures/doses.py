"""Dose and response as small multiples: a panel a perturbation, a line an estimator."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from statistics import median
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from slamreplay.geometry.se2 import Array
from slamreplay.replay.dose import DoseCurve, DoseResults, Limit
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
    Part,
)

#: A level to its place on the axis.
Place = Callable[[float], float]

_COLUMNS = 3
_LOOKS = [(BLUE, "o"), (VERMILLION, "s"), (GREEN, "D"), (PURPLE, "^"), (ORANGE, "v"), (SKY, "P")]
#: Letters in a line of what a level does: no wider than its panel.
_WORDS = 56
#: From this many times the range of its levels away a baseline is drawn beside them.
_REMOTE = 4.0
#: From this many limits on a response is drawn on a logarithmic axis beyond the limit.
_FAR = 4.0


def doses_figure(results: DoseResults, words: dict[str, str], width_in: float = 11.0) -> Figure:
    """The response of the first limit's metric against the level.

    Args:
        results: of a design.
        words: by `NAME.VARIANT`, what the level does, in a few words.
        width_in: of the paper; narrow paper has one panel a row.
    """
    parts = dose_parts(results, words)
    size = canvas.text_size(width_in)
    columns = min(1 if width_in < 5.0 else 2 if width_in < 9.0 else _COLUMNS, len(parts))
    rows = -(-len(parts) // columns)
    figure = canvas.new_figure(width_in, 0.7 + 3.1 * rows)
    every = figure.subplots(rows, columns, squeeze=False).ravel()
    handles = canvas.draw_parts(parts, every[: len(parts)], size)
    for k, axes in enumerate(every):
        if k >= len(parts):
            axes.set_visible(False)
        elif k % columns:
            axes.set_ylabel("")
    canvas.legend(figure, handles, size, 1 if width_in < 5.0 else 3)
    return figure


def dose_parts(results: DoseResults, words: dict[str, str]) -> tuple[Part, ...]:
    """A part for each perturbation, as `doses_figure` has them."""
    limit = results.limits[0]
    names = list(dict.fromkeys(curve.estimator for curve in results.curves))
    looks = {name: _LOOKS[k % len(_LOOKS)] for k, name in enumerate(names)}
    top = _top(results.curves, limit)

    def draw(curves: list[DoseCurve], axes: Axes, size: float) -> list[object]:
        name = curves[0].perturbation
        told = fill(words.get(name, ""), _WORDS)
        _panel(axes, curves, limit, looks, top, size)
        axes.set_title(name, loc="left", fontsize=size + 1, color=INK, weight="bold",
                       pad=20 + 11 * told.count("\n"))  # fmt: skip
        axes.text(0.0, 1.02, told, transform=axes.transAxes,
                  fontsize=size - 1.5, color=FAINT, va="bottom", in_layout=False)  # fmt: skip
        return _handles(looks, limit, results)

    return tuple(
        Part(_part_name(curves), partial(draw, curves)) for curves in _panels(results.curves)
    )


def _part_name(curves: Sequence[DoseCurve]) -> str:
    return f"{curves[0].perturbation}{'_below' if _is_below(curves[0]) else ''}"


def _panels(curves: Sequence[DoseCurve]) -> list[list[DoseCurve]]:
    """Curves of one perturbation on one side of its baseline, in the design's order."""
    found: dict[tuple[str, bool], list[DoseCurve]] = {}
    for curve in curves:
        if curve.responses:
            found.setdefault((curve.perturbation, _is_below(curve)), []).append(curve)
    return list(found.values()) or [[curve] for curve in curves[:1]]


def _is_below(curve: DoseCurve) -> bool:
    return bool(curve.responses) and curve.responses[-1].level < curve.baseline


def _top(curves: Sequence[DoseCurve], limit: Limit) -> float:
    values = [v for c in curves for r in c.responses for v in r.values.get(limit.metric, ())]
    return max([limit.at_most, *(v for v in values if v is not None)])


def _panel(
    axes: Axes,
    curves: Sequence[DoseCurve],
    limit: Limit,
    looks: dict[str, tuple[str, str]],
    top: float,
    size: float,
) -> None:
    unit = curves[0].unit
    canvas.dress(axes, f"level [{unit}]", response_label(limit), size)
    place = _place_of(curves)
    for k, curve in enumerate(curves):
        colour, marker = looks[curve.estimator]
        _line(axes, curve, limit, place, colour, marker)
        critical = next((c for c in curve.critical if c.metric == limit.metric), None)
        if critical is None or critical.level is None or critical.outcome == "always":
            continue
        at = place(critical.level)
        axes.axvline(at, color=colour, lw=1.0, ls=(0, (2, 2)), zorder=3)
        low = at if critical.low is None else place(critical.low)
        ends = [low, axes.get_xlim()[1] if critical.high is None else place(critical.high)]
        y = _mark_at(limit, top, k)
        axes.plot(ends, [y, y], color=colour, lw=5.0, alpha=0.45, solid_capstyle="butt", zorder=5)
        axes.plot([at], [y], marker="|", ms=11, mew=2.2, color=colour, zorder=6)
    axes.axhline(limit.at_most, color=INK, lw=1.2, ls=(0, (6, 3)), zorder=2)
    _scale(axes, limit, top)
    _ticks(axes, curves, place)


def _line(
    axes: Axes, curve: DoseCurve, limit: Limit, place: Place, colour: str, marker: str
) -> None:
    """Through the levels that every seed has; seeds that went on by themselves are dots.

    A search sends a seed to a level because of what it did beside it: a median there would be of
    the chosen ones.
    """
    rows, alone = [], []
    for response in curve.responses:
        values = response.values.get(limit.metric, ())
        known = [v for v in values if v is not None]
        if known and len(known) == len(values):
            rows.append((place(response.level), median(known), min(known), max(known)))
        alone += [(place(response.level), v) for v in known if len(known) < len(values)]
    if rows:
        x, middle, low, high = np.array(rows).T
        axes.fill_between(x, low, high, color=colour, alpha=0.16, lw=0.0, zorder=2)
        axes.plot(x, middle, color=colour, marker=marker, ms=4.5, lw=1.6, zorder=4)
    if alone:
        axes.plot(*np.array(alone).T, color=colour, marker=marker, ms=3.0, lw=0.0, alpha=0.55,
                  zorder=4)  # fmt: skip


def _place_of(curves: Sequence[DoseCurve]) -> Place:
    """Where levels go by factors, their logarithms, with the baseline a step to the left."""
    baseline = curves[0].baseline
    first, far = _reach(curves)
    if _is_scale(curves):
        return math.log10
    if not curves[0].by_factor:
        if not _is_remote(curves):
            return lambda level: level
        side = -1.0 if _is_below(curves[0]) else 1.0
        beside = baseline + side * (first - 0.2 * (far - first))
        return lambda level: beside if level == baseline else level
    left = math.log10(first) - 0.12 * max(math.log10(far / first), 1.0)

    def place(level: float) -> float:
        return left if level == baseline else math.log10(abs(level - baseline))

    return place


def _reach(curves: Sequence[DoseCurve]) -> tuple[float, float]:
    """Least and greatest distance of a level from the baseline."""
    offsets = [abs(r.level - curves[0].baseline) for c in curves for r in c.responses[1:]]
    return min(offsets, default=0.0), max(offsets, default=0.0)


def _is_scale(curves: Sequence[DoseCurve]) -> bool:
    return all(curve.is_scale for curve in curves)


def _is_remote(curves: Sequence[DoseCurve]) -> bool:
    """Whether the baseline is so far away that all levels would be one point beside it."""
    first, far = _reach(curves)
    if _is_scale(curves):
        return False
    return not curves[0].by_factor and far > first > _REMOTE * (far - first)


def _ticks(axes: Axes, curves: Sequence[DoseCurve], place: Place) -> None:
    baseline, side = curves[0].baseline, -1.0 if _is_below(curves[0]) else 1.0
    if _is_scale(curves):
        least, most = (f([r.level for c in curves for r in c.responses]) for f in (min, max))
        shown = [t for t in _tidy(least, most) if 0.999 * least <= t <= 1.001 * most]
        axes.set_xticks([place(t) for t in shown], [f"{t:g}" for t in shown])
        if side < 0.0:
            axes.invert_xaxis()
        return
    if not curves[0].by_factor:
        if _is_remote(curves):
            first, far = (baseline + side * d for d in _reach(curves))
            inner = [t for t in MaxNLocator(4).tick_values(*sorted((first, far)))
                     if min(first, far) <= t <= max(first, far)]  # fmt: skip
            labels = [f"{level:g}" for level in [baseline, *inner]]
            axes.set_xticks([place(baseline), *inner], labels)
        if side < 0.0:
            axes.invert_xaxis()
        return
    offsets = sorted({abs(r.level - baseline) for c in curves for r in c.responses[1:]})
    shown = [
        t for t in _tidy(offsets[0], offsets[-1]) if offsets[0] * 0.999 <= t <= offsets[-1] * 1.001
    ]
    levels = [baseline, *(float(f"{baseline + side * t:.6g}") for t in shown)]
    axes.set_xticks([place(level) for level in levels], [f"{level:g}" for level in levels])


def _tidy(least: float, most: float) -> list[float]:
    """Numbers for a logarithmic axis, a little beyond both ends; few for many decades."""
    decades = range(math.floor(math.log10(least)), math.ceil(math.log10(most)) + 1)
    between = (1.0, 3.0) if len(decades) < 5 else (1.0,)
    return [float(f"{m * 10.0**e:.6g}") for e in decades for m in between]


def _scale(axes: Axes, limit: Limit, top: float) -> None:
    """One scale for all panels: beyond the limit by factors where responses go far."""
    if limit.at_most > 0.0 and top > _FAR * limit.at_most:
        axes.set_yscale("symlog", linthresh=limit.at_most, linscale=0.8)
        steps = limit.at_most * 10.0 ** np.arange(0.5, 12.0, 0.5)
        axes.set_yticks([0.0, limit.at_most, *_shown(steps[steps < 1.3 * top])])
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:.2g}")
        axes.minorticks_off()
        axes.set_ylim(-0.08 * limit.at_most, 1.6 * top)
    else:
        axes.set_ylim(-0.03 * max(top, 1e-9), 1.12 * max(top, 1e-9))


def _shown(steps: Array) -> list[float]:
    return [float(f"{step:.2g}") for step in steps]


def _mark_at(limit: Limit, top: float, k: int) -> float:
    """Where an interval is drawn: under the limit, one below the other."""
    reach = limit.at_most if limit.at_most > 0.0 else top
    return reach * (0.88 - 0.13 * k)


def response_label(limit: Limit) -> str:
    """What the first limit is of, with its unit: the ordinate."""
    name, _, unit = limit.metric.rpartition("_")
    is_unit = unit in ("m", "s", "deg", "rad")
    said, above, _ = limit.title.rpartition(" above ")
    short = said if above else (name if is_unit else limit.metric).replace("_", " ")
    return f"{fill(short, 32)} [{unit if is_unit else 1}]"


def _handles(looks: dict[str, tuple[str, str]], limit: Limit, results: DoseResults) -> list[object]:
    several = any(len(curve.seeds) > 1 for curve in results.curves)
    lines = [
        Line2D([], [], color=colour, marker=marker, ms=4.5, lw=1.6,
               label=f"{name}, median over seeds" if several else name)
        for name, (colour, marker) in looks.items()
    ]  # fmt: skip
    band: list[object] = []
    if several:
        band = [Patch(color=FAINT, alpha=0.3, label="least to most over seeds"),
                Line2D([], [], color=FAINT, marker="o", ms=3.0, lw=0.0,
                       label="single seeds, where the search took them")]  # fmt: skip
    return [
        *lines,
        *band,
        Line2D([], [], color=INK, lw=1.2, ls=(0, (6, 3)), label=f"limit: {limit.title}"),
        Line2D([], [], color=FAINT, lw=5.0, alpha=0.6, marker="|", ms=11, mew=2.2,
               label="critical level and its interval"),
    ]  # fmt: skip
