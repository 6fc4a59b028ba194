"""A matrix: parts left out of a log against questions, and what became of each answer."""

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
#: What became of an answer: the cell's colour, its text's colour and weight, and the legend.
_LOOKS = {
    "same": ("#eef1ee", FAINT, "normal", "the same answer as with all eight parts"),
    "other": (ORANGE, INK, "bold", "another answer"),
    "none": (VERMILLION, "white", "bold", "no answer"),
}
_ROW_IN, _LETTERS = 0.36, 13


class Cell(NamedTuple):
    """A question, its answer in a few words, and what became of it: same, other, none."""

    question: str
    text: str
    became: str


def minimum_replay_figure(matrices: Mapping[str, Mapping[str, Sequence[Cell]]]) -> Figure:
    """One matrix below the other.

    Args:
        matrices: by title; rows by what was left out, each with a cell for every question.
    """
    lines = [len(rows) for rows in matrices.values()]
    heights = [n * _ROW_IN + 0.85 for n in lines]
    figure = canvas.new_figure(canvas.WIDE, sum(heights) + 0.4)
    panels = figure.subplots(len(lines), 1, height_ratios=heights, squeeze=False)[:, 0]
    for axes, (title, rows) in zip(panels, matrices.items(), strict=True):
        _matrix(axes, title, rows)
    handles = [Patch(color=face, label=words) for face, _, _, words in _LOOKS.values()]
    canvas.legend(figure, handles, _SIZE, 3)
    return figure


def _matrix(axes: Axes, title: str, rows: Mapping[str, Sequence[Cell]]) -> None:
    columns = [cell.question for cell in next(iter(rows.values()))]
    for y, cells in enumerate(rows.values()):
        for x, cell in enumerate(cells):
            face, ink, weight, _ = _LOOKS[cell.became]
            axes.add_patch(Rectangle((x + 0.03, y + 0.05), 0.94, 0.9, facecolor=face, lw=0.0))
            axes.text(x + 0.5, y + 0.5, textwrap.fill(cell.text, _LETTERS + 4), color=ink,
                      ha="center", va="center", fontsize=_SIZE - 2.0, weight=weight,
                      linespacing=0.95)  # fmt: skip
    axes.set_xlim(0.0, len(columns))
    axes.set_ylim(len(rows), 0.0)
    axes.xaxis.tick_top()
    wrapped = [textwrap.fill(name, _LETTERS) for name in columns]
    axes.set_xticks([x + 0.5 for x in range(len(columns))], wrapped, fontsize=_SIZE - 0.5)
    axes.set_yticks([y + 0.5 for y in range(len(rows))],
                    ["all eight" if name == "nothing" else f"no {name}" for name in rows],
                    fontsize=_SIZE)  # fmt: skip
    axes.tick_params(length=0, colors=INK)
    for side in axes.spines.values():
        side.set_visible(False)
    axes.set_title(title, loc="left", fontsize=_SIZE + 1.5, color=INK, weight="bold", pad=8)
