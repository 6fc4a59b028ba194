"""A figure of one plane with equal axes, cut so that neither the plane nor its legend is small."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from slamreplay.report.figures import canvas

#: Inches that labels and ticks take, a legend beside the plane, and a line of one below it.
_LEFT, _BELOW, _LEGEND, _LINE = 0.75, 0.55, 2.05, 0.22
#: No plane is lower, and on a desktop no figure is higher: the first screen holds it whole.
_LEAST, _MOST, _MOST_NARROW = 1.8, 5.2, 6.6


def fit_plane(figure: Figure, aspect: float, handles: Sequence[object], width_in: float) -> None:
    """Set the figure's size, and its legend beside a high plane or below a wide one.

    Args:
        figure: with one pair of equal axes.
        aspect: height over width of what the axes show.
        handles: of the legend.
        width_in: of the paper; narrow paper has the legend below in any case.
    """
    _set_size(figure, aspect, handles, width_in)
    # Ticks change as equal axes shrink into their box: laid out once, the ordinate's label is cut.
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        engine.execute(figure)


def _set_size(figure: Figure, aspect: float, handles: Sequence[object], width_in: float) -> None:
    size = canvas.text_size(width_in)
    columns = 2 if width_in < 5.0 else 4
    lines = _LINE * size / 9.5 * -(-len(handles) // columns)
    plain_in = width_in - _LEFT
    if width_in < 5.0:
        plane = min(max(plain_in * aspect, _LEAST), _MOST_NARROW)
        canvas.legend(figure, handles, size, columns)
        figure.set_size_inches(width_in, plane + _BELOW + lines)
        return
    below = min(plain_in, (_MOST - _BELOW - lines) / aspect)
    beside = min(plain_in - _LEGEND, (_MOST - _BELOW) / aspect)
    if beside > below:
        canvas.legend(figure, handles, size, columns=1, place="outside right upper")
        figure.set_size_inches(beside + _LEFT + _LEGEND, beside * aspect + _BELOW)
    else:
        canvas.legend(figure, handles, size, columns)
        figure.set_size_inches(width_in, max(below * aspect, _LEAST) + _BELOW + lines)
