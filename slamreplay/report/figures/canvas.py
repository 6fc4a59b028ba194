"""Paper and ink: the palette, axes that carry units, and a figure as deterministic SVG bytes."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure, SubFigure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from slamreplay.evidence import colours
from slamreplay.geometry.se2 import Array

if TYPE_CHECKING:
    import PIL.Image

BLUE, SKY, GREEN, YELLOW = colours.BLUE, colours.SKY, colours.GREEN, colours.YELLOW
ORANGE, VERMILLION, PURPLE = colours.ORANGE, colours.VERMILLION, colours.PURPLE
INK, FAINT, RULE = "#22272b", "#6b7278", "#dfe1dc"

#: Beams and cells that contradict the map: the family of the state's own colour.
APPEARED, REMOVED = ORANGE, YELLOW

STATE_COLOURS: dict[str, str] = dict(colours.STATES.items())

#: Inches: a desktop column, the half of it beside the facts, and a phone.
WIDE, BESIDE, NARROW = 11.0, 7.4, 3.9
#: One column of a two-column page, and both of them: IEEE's templates have 3.5 and 7.16.
COLUMN, PAGE = 3.5, 7.16


@dataclass(frozen=True)
class Part:
    """One pair of axes of a panel: `draw(axes, size)` fills them and gives the legend's handles.

    Axes may be anybody's: what is drawn in them depends on nothing around them.
    """

    name: str
    draw: Callable[[Axes, float], list[object]]


_STYLE: dict[Any, Any] = {
    "svg.hashsalt": "slamreplay",  # else ids are random
    "svg.fonttype": "none",  # text stays text
    "font.family": "DejaVu Sans",  # ships with matplotlib: the same layout on every machine
}


@contextmanager
def plain_style() -> Iterator[None]:
    """Draw and save inside this: the user's own matplotlibrc does not reach the report."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure that lays itself out."""
    return Figure(figsize=(width_in, height_in), layout="constrained", facecolor="white")


def text_size(width_in: float) -> float:
    """Points: smaller where the paper is."""
    return 8.0 if width_in < 7.3 else 9.5


def plain(text: str, most: int = 40) -> str:
    """Text that may hold a log's names: none of it is a formula, and its middle is left out."""
    if len(text) > most:
        text = f"{text[: most - 9]}...{text[-6:]}"
    return text.replace("$", r"\$")


def dress(axes: Axes, x: str, y: str, size: float) -> None:
    """Labels with units, quiet ticks, no box."""
    axes.set_xlabel(plain(x), fontsize=size, color=INK)
    axes.set_ylabel(plain(y), fontsize=size, color=INK)
    axes.tick_params(labelsize=size - 0.5, colors=FAINT, length=3, width=0.6)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(RULE)
    axes.grid(visible=True, color=RULE, linewidth=0.6, zorder=0)
    axes.set_axisbelow(True)


def draw_parts(parts: Iterable[Part], every: Iterable[Axes], size: float) -> list[object]:
    """Draw each part into its axes; the handles of all, each label once."""
    found: dict[str, Any] = {}
    for part, axes in zip(parts, every, strict=True):
        for handle in part.draw(axes, size):
            found.setdefault(handle.get_label(), handle)  # type: ignore[attr-defined]
    return list(found.values())


def stacked(every: Iterable[Axes]) -> None:
    """Axes below each other over one abscissa: only the last names it."""
    for axes in list(every)[:-1]:
        axes.set_xlabel("")
        axes.tick_params(labelbottom=False)


def legend(
    figure: Figure,
    handles: Iterable[object],
    size: float,
    columns: int,
    place: Literal["outside lower center", "outside right upper"] = "outside lower center",
) -> None:
    """One legend under the axes, or at another place outside them, where it hides nothing."""
    figure.legend(
        handles=list(handles),
        loc=place,
        ncols=columns,
        fontsize=size,
        frameon=False,
        labelcolor=INK,
        handlelength=1.8,
        columnspacing=1.6,
    )


def svg_bytes(figure: Figure) -> bytes:
    """The figure as an SVG file: same figure, same bytes."""
    return f'<?xml version="1.0" encoding="utf-8"?>\n{svg_text(figure, dark=False)}\n'.encode()


def svg_text(figure: Figure, *, dark: bool) -> str:
    """The figure as SVG, with colours for dark pages as well where they are asked for."""
    from slamreplay.report.figures.svg import small_svg

    _settle(figure)
    sink = io.BytesIO()
    metadata = {"Date": None, "Creator": None, "Format": None, "Type": None}
    FigureCanvasSVG(figure).print_figure(sink, format="svg", dpi=150, metadata=metadata)
    return small_svg(sink.getvalue().decode(), dark=dark)


def png_bytes(figure: Figure, dpi: int = 130) -> bytes:
    """The figure as PNG of 128 colours, a third of the size: same figure, same bytes."""
    sink = io.BytesIO()
    few_colours(pixels(figure, dpi)).save(sink, "png", optimize=True)
    return sink.getvalue()


def pixels(figure: Figure, dpi: int) -> PIL.Image.Image:
    """The figure as an RGB picture."""
    from PIL import Image

    _settle(figure)
    figure.set_dpi(dpi)
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())[:, :, :3].copy())


def few_colours(picture: PIL.Image.Image) -> PIL.Image.Image:
    """The same picture in 128 colours, without dots between them."""
    from PIL import Image

    return picture.quantize(128, dither=Image.Dither.NONE)


def _settle(figure: Figure) -> None:
    """Lay out once, and snap to a millionth of the paper.

    The solver behind the layout goes through its variables in the order of their addresses, so
    that its last digits differ between two runs of the program.
    """
    if not isinstance(figure.get_layout_engine(), ConstrainedLayoutEngine):
        return
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for part in _parts(figure):
        part.bbox_relative.set_points(part.bbox_relative.get_points().round(6))
    for axes in figure.axes:
        axes.set_position(Bbox(axes.get_position(original=True).get_points().round(6)))


def _parts(figure: Figure | SubFigure) -> Iterator[Any]:
    """Every figure within a figure."""
    for part in figure.subfigs:
        yield part
        yield from _parts(part)


def thinned(t: Array, y: Array, most: int = 1200) -> tuple[Array, Array]:
    """A curve with no more than about `most` points that keeps every peak and every gap.

    Of each run of samples the lowest and the highest stay, in order; a run without numbers stays
    as one NaN.
    """
    if len(t) <= most:
        return t, y
    keep: list[int] = []
    for run in np.array_split(np.arange(len(t)), most // 2):
        known = run[np.isfinite(y[run])]
        if len(known):
            keep += sorted({int(known[np.argmin(y[known])]), int(known[np.argmax(y[known])])})
        else:
            keep.append(int(run[0]))
    return t[keep], y[keep]


def strided(rows: NDArray, most: int = 2500) -> NDArray:
    """Every k-th row, so that about `most` stay; for paths, where no sample is a peak."""
    return rows[:: max(1, -(-len(rows) // most))]
