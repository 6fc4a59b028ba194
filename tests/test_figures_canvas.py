"""Figures are the same bytes in every run of the program."""

import io

import numpy as np
import pytest
from matplotlib.lines import Line2D
from PIL import Image

from slamreplay.report.figures.canvas import (
    BESIDE,
    dress,
    new_figure,
    plain_style,
    png_bytes,
    svg_bytes,
)
from slamreplay.report.figures.fitted import fit_plane


def drawn():
    figure = new_figure(6.0, 3.0)
    left, right = figure.subfigures(1, 2, width_ratios=[1.0, 1.7])
    for axes in (left.subplots(), *right.subplots(2, 1)):
        axes.plot([0.0, 1.0], [0.0, np.pi])
        axes.set_xlabel("x [m]")
    return figure


def test_layout_is_snapped_so_that_the_solvers_last_digits_do_not_show():
    with plain_style():
        figure = drawn()
        first = svg_bytes(figure)

    for box in (
        *(a.get_position() for a in figure.axes),
        *(f.bbox_relative for f in figure.subfigs),
    ):
        points = box.get_points()
        np.testing.assert_array_equal(points, points.round(6))
    with plain_style():
        assert svg_bytes(drawn()) == first == svg_bytes(figure)


def test_png_is_a_picture_of_the_size_asked_for():
    with plain_style():
        once, again = png_bytes(drawn(), dpi=50), png_bytes(drawn(), dpi=50)

    assert once == again
    assert Image.open(io.BytesIO(once)).size == (300, 150)


@pytest.mark.parametrize("height", [0.7, 1.06, 1.3, 2.0])
def test_labels_of_a_plane_that_was_cut_to_fit_stay_on_the_paper(height):
    with plain_style():
        figure = new_figure(BESIDE, BESIDE)
        axes = figure.add_subplot()
        dress(axes, "x in map [m]", "y in map [m]", 9.5)
        axes.set(aspect="equal", xlim=(-3.1, 7.7), ylim=(-4.3, -4.3 + 10.8 * height))
        handles = [Line2D([], [], label="stands there, not mapped") for _ in range(5)]
        fit_plane(figure, height, handles, BESIDE)
        svg_bytes(figure)
        boxes = [part.get_window_extent() for part in (axes.xaxis.label, axes.yaxis.label)]

    spare = 2.0  # a text's box is larger than its ink, px
    for box in boxes:
        assert -spare <= box.x0 < box.x1 <= figure.bbox.width + spare
        assert -spare <= box.y0 < box.y1 <= figure.bbox.height + spare
