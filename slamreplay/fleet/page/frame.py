"""A map's frame as a drawing: how metres become units of an SVG, and what stands at its edges."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slamreplay.fleet.page.words import Box

#: Units of a drawing: its width, what its axes take, and its greatest height. It is shown about as
#: many pixels wide, so its text is of the page's size.
WIDTH, LEFT, BOTTOM, EDGE, MOST_HIGH = 400.0, 34.0, 34.0, 8.0, 460.0


@dataclass(frozen=True)
class Tick:
    """A number on an axis, at a unit of the drawing."""

    at: float
    text: str


@dataclass(frozen=True)
class Frame:
    """A drawing of a part of a map.

    Attributes:
        width: of the drawing, as is `height`, in units.
        height: of it.
        clip: x, y, width and height of what is not axes.
        transform: SVG's, from the map's frame (m, y up) to units.
        x_ticks: along the lower edge.
        y_ticks: along the left edge.
        metre: units of a metre.
    """

    width: float
    height: float
    clip: tuple[float, float, float, float]
    transform: str
    x_ticks: tuple[Tick, ...]
    y_ticks: tuple[Tick, ...]
    metre: float


def frame_of(box: Box, *, axes: bool = True) -> Frame:
    """The drawing of a box (x_min, y_min, x_max, y_max), m.

    Args:
        box: it fills the width, unless it is too high for that.
        axes: whether there is room for numbers at the left and below.
    """
    x0, y0, x1, y1 = box
    left, bottom, edge = (LEFT, BOTTOM, EDGE) if axes else (0.0, 0.0, 0.0)
    wide, high = max(x1 - x0, 1e-6), max(y1 - y0, 1e-6)
    metre = min((WIDTH - left - edge) / wide, (MOST_HIGH - bottom - edge) / high)
    right = left + (WIDTH - left - edge + metre * wide) / 2.0
    start, low = right - metre * wide, edge + metre * high
    return Frame(
        WIDTH,
        round(low + bottom, 2),
        (round(start, 2), edge, round(metre * wide, 2), round(metre * high, 2)),
        f"translate({start:.2f} {low:.2f}) scale({metre:.5g} {-metre:.5g}) "
        f"translate({-x0:.6g} {-y0:.6g})",
        tuple(Tick(round(start + metre * (t - x0), 2), f"{t:g}") for t in ticks(x0, x1)),
        tuple(Tick(round(low - metre * (t - y0), 2), f"{t:g}") for t in ticks(y0, y1)),
        metre,
    )


def around(box: Box, *, margin_m: float, aspect: float, least_m: float) -> Box:
    """A box about another, of a given shape.

    Args:
        box: in the middle.
        margin_m: at least so much on every side.
        aspect: its width by its height.
        least_m: no less wide than this.
    """
    x, y = (box[0] + box[2]) / 2.0, (box[1] + box[3]) / 2.0
    wide = max(box[2] - box[0] + 2.0 * margin_m, aspect * (box[3] - box[1] + 2.0 * margin_m))
    half = max(wide, least_m) / 2.0
    return (x - half, y - half / aspect, x + half, y + half / aspect)


def ticks(low: float, high: float, most: int = 6) -> tuple[float, ...]:
    """Round numbers between two, at most so many: steps are 1, 2 or 5 of a power of ten."""
    step = nice((high - low) / most)
    first = math.ceil(low / step - 1e-9)
    return tuple(k * step for k in range(first, math.floor(high / step + 1e-9) + 1))


def nice(least: float) -> float:
    """The least of 1, 2 and 5 times a power of ten that is no less."""
    power = 10.0 ** math.floor(math.log10(max(least, 1e-9)))
    return next(power * k for k in (1.0, 2.0, 5.0, 10.0) if power * k >= least * (1.0 - 1e-9))
