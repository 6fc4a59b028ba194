"""A figure as PNG and SVG bytes that carry its title and caption."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import escape

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from slamreplay.report.figures.canvas import FAINT, few_colours, pixels, svg_bytes
from slamreplay.report.phrases import bound
from slamreplay.version import __version__

if TYPE_CHECKING:
    import PIL.Image

#: Dots per inch: journals ask for 300 of line art in colour or grey.
DPI = 300
_SIZE, _LEADING, _MARGIN_IN = 7.0, 1.35, 0.08


def captioned_svg(figure: Figure, title: str, caption: str) -> bytes:
    """The SVG with <title> and <desc> as its first children, as SVG 1.1 section 5.4 wants them."""
    text = svg_bytes(figure).decode()
    start = text.index(">", text.index("<svg ")) + 1
    head = f"\n <title>{escape(title)}</title>\n <desc>{escape(caption)}</desc>"
    return f"{text[:start]}{head}{text[start:]}".encode()


def captioned_png(figure: Figure, title: str, caption: str, dpi: int = DPI) -> bytes:
    """The PNG with the caption drawn below, and as text: Title, Description, Software."""
    from PIL import Image, PngImagePlugin

    above = pixels(figure, dpi)
    below = _written(bound(caption), float(figure.get_size_inches()[0]), dpi)
    whole = Image.new("RGB", (above.width, above.height + below.height), "white")
    whole.paste(above, (0, 0))
    whole.paste(below, (0, above.height))
    info = PngImagePlugin.PngInfo()
    for key, value in (
        ("Title", title),
        ("Description", caption),
        ("Software", f"slamreplay {__version__}"),
    ):
        info.add_itxt(key, value)  # UTF-8; tEXt has Latin-1 only
    sink = io.BytesIO()
    few_colours(whole).save(sink, "png", optimize=True, dpi=(dpi, dpi), pnginfo=info)
    return sink.getvalue()


def _written(text: str, width_in: float, dpi: int) -> PIL.Image.Image:
    """A paragraph on paper of its own, as wide as the figure."""
    paper: Any = Figure(figsize=(width_in, 1.0), dpi=dpi, facecolor="white")
    canvas: Any = FigureCanvasAgg(paper)
    renderer = canvas.get_renderer()
    probe = paper.text(0.0, 0.0, "", fontsize=_SIZE, parse_math=False)

    def length_in(line: str) -> float:
        probe.set_text(line)
        return float(probe.get_window_extent(renderer).width) / dpi

    lines = wrapped(text, width_in - 2.0 * _MARGIN_IN, length_in)
    probe.set_text("")
    step_in = _SIZE * _LEADING / 72.0
    height_in = len(lines) * step_in + 2.0 * _MARGIN_IN
    paper.set_size_inches(width_in, height_in)
    for row, line in enumerate(lines):
        y = 1.0 - (_MARGIN_IN + (row + 0.8) * step_in) / height_in
        paper.text(_MARGIN_IN / width_in, y, line, fontsize=_SIZE, color=FAINT, parse_math=False)
    return pixels(paper, dpi)


def wrapped(text: str, width_in: float, length_in: Any) -> list[str]:
    """Lines no longer than the paper, by `length_in(line)`; a word that is longer is cut."""
    lines: list[str] = []
    line = ""
    for word in text.split(" "):
        rest = word
        while rest:
            longer = f"{line} {rest}" if line else rest
            if length_in(longer) <= width_in:
                line, rest = longer, ""
            elif line:
                lines.append(line)
                line = ""
            else:
                fits = max(
                    (n for n in range(1, len(rest) + 1) if length_in(rest[:n]) <= width_in),
                    default=1,
                )
                lines.append(rest[:fits])
                rest = rest[fits:]
    return [*lines, line] if line else lines
