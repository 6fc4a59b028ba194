"""report.html: one file, no network; nothing in it runs but the replay."""

from __future__ import annotations

from dataclasses import dataclass

from markupsafe import Markup
from matplotlib.figure import Figure

from slamreplay.evidence.result import Postmortem
from slamreplay.report.figures import canvas
from slamreplay.report.figures.panels import PANELS
from slamreplay.report.one_file import render, texts
from slamreplay.report.page import Page, page
from slamreplay.report.print_style import print_style
from slamreplay.report.replay.replay import replay_of
from slamreplay.report.sections import sections

#: Files of the templates' folder that go into the page as they are.
_STYLES = ("report.css", "replay/replay.css")
#: The replay, one idea each; together they are one module, in this order.
_SCRIPTS = tuple(f"replay/{name}.js" for name in (
    "data", "words", "ink", "view", "ground", "paths", "scans", "robots", "map", "bands", "plots",
    "lanes", "player", "pointer", "links", "switches", "keys", "start",
))  # fmt: skip


@dataclass(frozen=True)
class Picture:
    """One figure in two widths, as data URIs, and what it shows in words."""

    wide: Markup
    narrow: Markup
    alt: str


def html(post: Postmortem) -> str:
    """The whole page. Whatever came from the log is escaped by the template engine."""
    view = page(post)
    replay = replay_of(post)
    pictures = _pictures(post, view)
    return render(
        "report.html.j2",
        {"page": view, "replay": replay, "sections": sections(view, pictures), **pictures},
        styles=[*texts(_STYLES), print_style(view.title)],
        scripts=[] if replay is None else ["\n".join(texts(_SCRIPTS))],
    )


def _pictures(post: Postmortem, view: Page) -> dict[str, Picture | None]:
    return {
        "map": _picture(post, "map", canvas.BESIDE, view.map_alt),
        "course": _picture(post, "course", canvas.WIDE, view.course_alt),
        "covariance": _picture(post, "covariance", canvas.WIDE, view.covariance_alt),
        "consistency": _picture(post, "consistency", canvas.WIDE, view.consistency_alt),
        "doses": _picture(post, "doses", canvas.WIDE, view.design_alt),
        "graph": _picture(post, "graph", canvas.BESIDE, view.graph_alt),
        "reliability": _picture(post, "reliability", canvas.BESIDE, view.reliability_alt),
    }


def _picture(post: Postmortem, name: str, width_in: float, alt: str) -> Picture | None:
    draw = PANELS[name].figure
    with canvas.plain_style():
        wide, narrow = draw(post, width_in), draw(post, canvas.NARROW)
        if wide is None or narrow is None:
            return None
        return Picture(_uri(wide, spaced=True), _uri(narrow, spaced=False), alt)


def _uri(figure: Figure, *, spaced: bool) -> Markup:
    """The figure as an address, as text: base64 would be a third longer, and not be compressed.

    Args:
        figure: what it shows.
        spaced: whether the address may hold spaces, as that of an img may.
    """
    unsafe = '%#<>"&\n' if spaced else '%#<>"&\n '
    codes = {ord(letter): f"%{ord(letter):02X}" for letter in unsafe}
    text = canvas.svg_text(figure, dark=True).translate(codes)
    return Markup(f"data:image/svg+xml,{text}")  # noqa: S704 nothing is left that ends an attribute
