"""Do the errors have the distribution that the covariance says: PIT histogram and coverage."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from scipy.special import betaincinv

from slamreplay.consistency.belief.summary import ConsistencySummary
from slamreplay.consistency.statistics.distribution import LEVELS, Distribution
from slamreplay.consistency.statistics.mean_test import NOMINAL
from slamreplay.report.figures import canvas
from slamreplay.report.figures.canvas import BLUE, FAINT, SKY, VERMILLION, Part

#: One colour for each part of a pose, and a dash of its own beside it.
_LINES = ((BLUE, "-"), (VERMILLION, (0, (4, 1.6))))
#: Bars of the histogram, and how many where the samples are few.
_BARS, _FEW_BARS, _FEW = 10, 5, 50.0


def consistency_figure(summaries: tuple[ConsistencySummary, ...], width_in: float) -> Figure | None:
    """The first source's PIT histogram of each part, and how much its ellipses hold; None without.

    Args:
        summaries: sources, the best first.
        width_in: of the paper.
    """
    parts = consistency_parts(summaries)
    if not parts:
        return None
    narrow, size = width_in < 5.0, canvas.text_size(width_in)
    count = len(parts)
    if narrow:
        figure = canvas.new_figure(width_in, 0.6 + 2.5 * count)
        panels = list(figure.subplots(count, 1, squeeze=False)[:, 0])
    else:
        figure = canvas.new_figure(width_in, 4.0)
        panels = list(figure.subplots(1, count, squeeze=False)[0])
    handles = canvas.draw_parts(parts, panels, size)
    canvas.legend(figure, handles, size, columns=1 if narrow else len(handles))
    return figure


def consistency_parts(summaries: tuple[ConsistencySummary, ...]) -> tuple[Part, ...]:
    """A histogram for each part of the first source's pose, and coverage; nothing without any."""
    drawn = drawn_parts(summaries)
    if not drawn:
        return ()
    histograms = [
        Part(f"pit_{name.replace(' ', '_')}", partial(_draw_histogram, name, found, colour))
        for (name, found), (colour, _) in zip(drawn, _LINES, strict=False)
    ]
    return (*histograms, Part("coverage", partial(_draw_coverage, drawn)))


def _expected() -> list[object]:
    return [
        Patch(color=SKY, alpha=0.3, label="95 % of consistent beliefs lie within"),
        Line2D([], [], color=FAINT, ls="--", lw=1.0, label="what the covariance says"),
    ]


def drawn_parts(summaries: tuple[ConsistencySummary, ...]) -> list[tuple[str, Distribution]]:
    """Name and distribution of the first source's parts, as far as there are bars to draw."""
    parts = () if not summaries else summaries[0].parts
    told = [(p.name, p.distribution) for p in parts if p.distribution is not None]
    return [(name, found) for name, found in told if found.n >= _FEW_BARS][: len(_LINES)]


def bar_band(bars: int, n_eff: float) -> tuple[float, float]:
    """Shares within which all bars of a uniform histogram lie in 95 of 100 cases.

    Each bar's share is taken as beta of `n_eff` samples, after Bonferroni over the bars.
    """
    p, tail = 1.0 / bars, NOMINAL / (2.0 * bars)
    low, high = betaincinv(n_eff * p, n_eff * (1.0 - p), np.array([tail, 1.0 - tail]))
    return float(low), float(high)


def _draw_histogram(
    name: str, found: Distribution, colour: str, axes: Axes, size: float
) -> list[object]:
    canvas.dress(axes, f"{name}: F(NEES) [1]", "updates [share]", size)
    bars = _BARS if found.n_eff >= _FEW else _FEW_BARS
    counts, edges = np.histogram(found.pit, bars, (0.0, 1.0))
    low, high = bar_band(bars, found.n_eff)
    axes.axhspan(low, high, color=SKY, alpha=0.3, linewidth=0.0, zorder=1)
    share = counts / found.n
    axes.bar(edges[:-1], share, 0.94 / bars, align="edge", color=colour, alpha=0.75, zorder=2)
    axes.axhline(1.0 / bars, color=FAINT, linestyle="--", linewidth=1.0, zorder=3)
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.12 * max(high, float(share.max())))
    return _expected()


def _draw_coverage(drawn: list[tuple[str, Distribution]], axes: Axes, size: float) -> list[object]:
    canvas.dress(axes, "claimed by the ellipse [share]", "held by the ellipse [share]", size)
    claimed = np.linspace(0.0, 1.0, 201)
    most = max(found.most for _, found in drawn)  # of the part with the fewest samples
    low, high = np.clip(claimed - most, 0.0, 1.0), np.clip(claimed + most, 0.0, 1.0)
    axes.fill_between(claimed, low, high, color=SKY, alpha=0.3, linewidth=0.0, zorder=1)
    axes.plot([0.0, 1.0], [0.0, 1.0], color=FAINT, linestyle="--", linewidth=1.0, zorder=2)
    handles: list[object] = []
    for (name, found), (colour, dash) in zip(drawn, _LINES, strict=False):
        held = np.searchsorted(found.pit, claimed, side="right") / found.n
        axes.plot(claimed, held, color=colour, linestyle=dash, linewidth=1.5, zorder=4)
        axes.plot(LEVELS, found.coverage, "o", color=colour, ms=4, zorder=5)
        handles.append(Line2D([], [], color=colour, ls=dash, marker="o", ms=4, lw=1.5, label=name))
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.03)
    return [*handles, *_expected()]
