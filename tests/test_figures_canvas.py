"""Figures are the same bytes in every run of the program."""

import io

import numpy as np
from PIL import Image

from slamreplay.report.figures.canvas import new_figure, plain_style, png_bytes, svg_bytes


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
