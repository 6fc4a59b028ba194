"""The page's sections after its first screen, in the order of the questions that people ask."""

from __future__ import annotations

from dataclasses import dataclass

from slamreplay.fleet.page.view import FleetView


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Attributes:
        anchor: its id.
        title: its heading.
        short: its name in the table of contents.
        count: told beside it, 0 where nothing is counted.
        groups: index of its table in the view's `groups`; None of other sections.
    """

    anchor: str
    title: str
    short: str
    count: int = 0
    groups: int | None = None

    @property
    def template(self) -> str:
        """Where its text is."""
        return f"parts/{self.anchor if self.groups is None else 'group'}.html.j2"


def sections(view: FleetView) -> tuple[Section, ...]:
    """Those that have something to say."""
    every = (
        (True, "remap", "Which aisles need re-mapping", "Re-map", view.remap_count),
        (view.picks, "look", "Logs worth looking at first", "Look first", len(view.picks)),
        (view.maps, "where", "Where robots get lost, and where maps have aged", "Where", 0),
        (view.causes, "causes", "Top causes", "Causes", len(view.causes)),
        (True, "software", "Which software version got worse", "Software", 0),
        (True, "robots", "By robot", "Robots", 0),
        (True, "sites", "By site", "Sites", 0),
        (True, "versions", "By map version", "Maps", 0),
        (True, "days", "By day", "Days", 0),
        (view.gate_rows, "gate", "What the gate said", "Gate", 0),
        (True, "unread", "Failed logs, copies and remarks", "Failed", view.failed),
        (True, "data", "The same as tables", "Data, SQL", 0),
    )
    grouped = {"robots": 0, "sites": 1, "versions": 2, "days": 3}
    return tuple(
        Section(anchor, title, short, count, grouped.get(anchor))
        for told, anchor, title, short, count in every
        if told
    )  # fmt: skip
