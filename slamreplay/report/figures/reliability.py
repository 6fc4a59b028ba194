"""Reliability diagram: how sure the program said to be against how often it was right."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from slamreplay.report.figures import canvas
from slamreplay.report.figures.canvas import BLUE, FAINT, INK, VERMILLION, Part
from slamreplay.verdict.reliability import Reliability

_HEIGHT = 3.6


def reliability_figure(
    record: Reliability,
    width_in: float,
    confidence: float | None = None,
    answers: str = "moments",
) -> Figure | None:
    """Share of right moments over confidence, and how many there were; None without any.

    Args:
        record: what a benchmark measured.
        width_in: of the paper.
        confidence: of the log at hand, marked if it is given; 0 to 1.
        answers: what was counted.
    """
    if not record.bins:
        return None
    size = canvas.text_size(width_in)
    figure = canvas.new_figure(width_in, _HEIGHT)
    every = figure.subplots(2, 1, sharex=True, height_ratios=[2.6, 1.0])
    handles = canvas.draw_parts(reliability_parts(record, confidence, answers), every, size)
    canvas.stacked(every)
    canvas.legend(figure, handles, size, columns=3)
    return figure


def reliability_parts(
    record: Reliability, confidence: float | None = None, answers: str = "moments"
) -> tuple[Part, ...]:
    """Share of right answers and how many there were, both over confidence; nothing without any."""
    if not record.bins:
        return ()
    return (
        Part("right", lambda axes, size: _draw_share(axes, record, confidence, size)),
        Part("counts", lambda axes, size: _draw_count(axes, record, confidence, answers, size)),
    )


def _draw_share(
    share: Axes, record: Reliability, confidence: float | None, size: float
) -> list[object]:
    canvas.dress(share, "said confidence [1]", "was right [share]", size)
    said = np.array([b.said for b in record.bins])
    right = np.array([b.right for b in record.bins])
    share.plot([0.0, 1.0], [0.0, 1.0], color=FAINT, linestyle="--", linewidth=1.0, zorder=2)
    share.plot(said, right, color=BLUE, linewidth=1.2, marker="o", ms=5, zorder=4)
    share.set_xlim(0.0, 1.0)
    share.set_ylim(0.0, 1.03)
    handles: list[object] = [
        Line2D([], [], color=BLUE, marker="o", lw=1.2, label="measured"),
        Line2D([], [], color=FAINT, ls="--", lw=1.0, label="honest: said = right"),
    ]
    share.tick_params(labelcolor=INK)
    return [*handles, *_this_log(share, confidence)]


def _draw_count(
    count: Axes, record: Reliability, confidence: float | None, answers: str, size: float
) -> list[object]:
    canvas.dress(count, "said confidence [1]", f"{answers} [1]", size)
    for b in record.bins:
        count.bar(0.5 * (b.low + b.high), b.moments, 0.9 * (b.high - b.low), color=BLUE, alpha=0.6)
    count.set_yscale("log")
    count.set_ylim(0.8, 3.0 * max(b.moments for b in record.bins))
    count.set_xlim(0.0, 1.0)
    return _this_log(count, confidence)


def _this_log(axes: Axes, confidence: float | None) -> list[object]:
    if confidence is None:
        return []
    axes.axvline(confidence, color=VERMILLION, linewidth=1.4, zorder=3)
    return [Line2D([], [], color=VERMILLION, lw=1.4, label="this log")]
