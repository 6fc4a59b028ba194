"""Confusion matrix: what was said of logs whose cause is known."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from slamreplay.report.figures import canvas
from slamreplay.report.figures.canvas import BLUE, INK, RULE, VERMILLION

#: Inches of a row, and of what stands around all rows.
_ROW, _AROUND = 0.34, 1.5
_SHADES = LinearSegmentedColormap.from_list("share", ["#ffffff", BLUE])


def confusion_figure(matrix: Mapping[str, Mapping[str, int]], width_in: float) -> Figure | None:
    """Rows are known causes, columns answers; shaded by the row's share. None without a log.

    Right answers have a frame in ink: more than one where several are right. Wrong ones have their
    counts in red.

    Args:
        matrix: label to counts by answer; a label is one or more answers, joined by " or ".
        width_in: of the paper.
    """
    labels = list(matrix)
    names = list(dict.fromkeys(n for label in labels for n in label.split(" or ")))
    names += [n for said in matrix.values() for n in said if n not in names]
    names = list(dict.fromkeys(names))
    if not labels:
        return None
    size = canvas.text_size(width_in)
    counts = np.array([[matrix[label].get(n, 0) for n in names] for label in labels])
    share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    figure = canvas.new_figure(width_in, _AROUND + _ROW * len(labels))
    axes = figure.subplots()
    axes.imshow(share, cmap=_SHADES, vmin=0.0, vmax=1.0, aspect="auto")
    for row, label in enumerate(labels):
        right = label.split(" or ")
        for column, name in enumerate(names):
            if name in right:
                frame = (column - 0.46, row - 0.44)
                axes.add_patch(Rectangle(frame, 0.92, 0.88, fill=False, ec=INK, lw=1.0))
            n = int(counts[row, column])
            if n:
                wrong = "white" if share[row, column] > 0.6 else VERMILLION
                ink = "white" if share[row, column] > 0.6 else INK
                colour = ink if name in right else wrong
                axes.text(column, row, str(n), ha="center", va="center", color=colour,
                          fontsize=size)  # fmt: skip
    rows = [f"{label.replace('_', ' ')} ({counts[i].sum()})" for i, label in enumerate(labels)]
    axes.set_yticks(range(len(labels)), rows, fontsize=size, color=INK)
    columns = [n.replace("_", "\n", 1).replace("_", " ") for n in names]
    axes.set_xticks(range(len(names)), columns, fontsize=size - 1.0, color=INK)
    axes.set_xlabel("said", fontsize=size, color=INK)
    axes.set_ylabel("known cause (logs)", fontsize=size, color=INK)
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_color(RULE)
    return figure
