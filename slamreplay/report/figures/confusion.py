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
_RIGHT = LinearSegmentedColormap.from_list("right", ["#ffffff", BLUE])
_WRONG = LinearSegmentedColormap.from_list("wrong", ["#ffffff", VERMILLION])


def confusion_figure(matrix: Mapping[str, Mapping[str, int]], width_in: float) -> Figure | None:
    """Rows are known causes, columns answers; shaded by the row's share. None without a log.

    Right answers are blue in a frame: more than one where several are right. Wrong ones are red.

    Args:
        matrix: label to counts by answer; a label is one or more answers, joined by " or ".
        width_in: of the paper.
    """
    labels = list(matrix)
    right_names = [n for label in labels for n in label.split(" or ")]
    names = list(dict.fromkeys([*right_names, *(n for said in matrix.values() for n in said)]))
    if not labels:
        return None
    size = canvas.text_size(width_in)
    counts = np.array([[matrix[label].get(n, 0) for n in names] for label in labels])
    share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    figure = canvas.new_figure(width_in, _AROUND + _ROW * len(labels))
    axes = figure.subplots()
    is_right = np.array([[n in label.split(" or ") for n in names] for label in labels])
    shade = np.where(is_right[..., None], _RIGHT(share), _WRONG(share))
    axes.imshow(shade, aspect="auto")
    for row, column in np.argwhere(is_right).tolist():
        frame = (column - 0.46, row - 0.44)
        axes.add_patch(Rectangle(frame, 0.92, 0.88, fill=False, ec=INK, lw=1.0))
    for row, column in np.argwhere(counts > 0).tolist():
        ink = "white" if share[row, column] > 0.5 else INK
        axes.text(
            column,
            row,
            str(int(counts[row, column])),
            ha="center",
            va="center",
            color=ink,
            fontsize=size,
        )
    rows = [f"{label.replace('_', ' ')} ({counts[i].sum()})" for i, label in enumerate(labels)]
    axes.set_yticks(range(len(labels)), rows, fontsize=size, color=INK)
    columns = [n.replace("over", "over-_").replace("_", "\n") for n in names]
    axes.set_xticks(range(len(names)), columns, fontsize=size - 1.0, color=INK)
    axes.set_xlabel("said", fontsize=size, color=INK)
    axes.set_ylabel("known cause (logs)", fontsize=size, color=INK)
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_color(RULE)
    return figure
