"""fleet.html: one file, no network; nothing in it runs but the sorting of tables."""

from __future__ import annotations

from slamreplay.fleet.page.sections import sections
from slamreplay.fleet.page.view import FleetView
from slamreplay.report.one_file import render, texts
from slamreplay.report.print_style import print_style

_PACKAGE = "slamreplay.fleet.page"


def fleet_html(view: FleetView) -> str:
    """The whole page. Whatever came from logs and labels is escaped by the template engine."""
    return render(
        "fleet.html.j2",
        {"page": view, "sections": sections(view)},
        styles=[
            *texts(["report.css"]),
            *texts(["fleet.css"], _PACKAGE),
            print_style(view.title, "slamreplay fleet"),
        ],
        scripts=texts(["sort.js"], _PACKAGE),
        package=_PACKAGE,
    )
