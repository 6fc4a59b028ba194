"""Matrices of short answers: what was done in the rows, what was asked in the columns."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from slamreplay.report.figures import canvas
from slamreplay.report.figures.canvas import FAINT, INK, ORANGE, VERMILLION

_SIZE = 9.5
#: How a cell looks by what became of its answer: colour, and its text's colour and weight.
_LOOKS = {
    "same": ("#eef1ee", FAINT, "normal"),
    "other": (ORANGE, INK, "bold"),
    "none": (VERMILLION, "white", "bold"),
}
_ROW_IN, _LETTERS = 0.36, 13


class Cell(NamedTuple):
    """A question, its answer in a few words, and what became of it: same, other, none."""

    question: str
    text: str
    became: str


def matrix_figure(
    matrices: Mapping[str, Mapping[str, Sequence[Cell]]], words: Mapping[str, str]
) -> Figure:
    """One matrix below the other.

    Args:
        matrices: by title; rows by label, each with a cell for every question.
        words: what `same`, `other` and `none` mean, for the legend.
    """
    lines = [len(rows) for rows in matrices.values()]
    heights = [n * _ROW_IN + 0.85 for n in lines]
    figure = canvas.new_figure(canvas.WIDE, sum(heights) + 0.4)
    panels = figure.subplots(len(lines), 1, height_ratios=heights, squeeze=False)[:, 0]
    for axes, (title, rows) in zip(panels, matrices.items(), strict=True):
        _matrix(axes, title, rows)
    handles = [Patch(color=_LOOKS[became][0], label=label) for became, label in words.items()]
    canvas.legend(figure, handles, _SIZE, 3)
    return figure


def _matrix(axes: Axes, title: str, rows: Mapping[str, Sequence[Cell]]) -> None:
    columns = [cell.question for cell in next(iter(rows.values()))]
    for y, cells in enumerate(rows.values()):
        for x, cell in enumerate(cells):
            face, ink, weight = _LOOKS[cell.became]
            axes.add_patch(Rectangle((x + 0.03, y + 0.05), 0.94, 0.9, facecolor=face, lw=0.0))
            axes.text(x + 0.5, y + 0.5, textwrap.fill(cell.text, _LETTERS + 4), color=ink,
                      ha="center", va="center", fontsize=_SIZE - 2.0, weight=weight,
                      linespacing=0.95)  # fmt: skip
    axes.set_xlim(0.0, len(columns))
    axes.set_ylim(len(rows), 0.0)
    axes.xaxis.tick_top()
    wrapped = [textwrap.fill(name, _LETTERS) for name in columns]
    axes.set_xticks([x + 0.5 for x in range(len(columns))], wrapped, fontsize=_SIZE - 0.5)
    axes.set_yticks([y + 0.5 for y in range(len(rows))], list(rows), fontsize=_SIZE)
    axes.tick_params(length=0, colors=INK)
    for side in axes.spines.values():
        side.set_visible(False)
    axes.set_title(title, loc="left", fontsize=_SIZE + 1.5, color=INK, weight="bold", pad=8)
