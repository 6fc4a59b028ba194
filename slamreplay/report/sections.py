"""The page's sections after its first screen: which of them a log fills, and in which order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from slamreplay.report.cells import Table
from slamreplay.report.page import Page


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Attributes:
        anchor: its id, and the name of its template.
        title: its heading.
        short: its name in the table of contents.
        count: told beside it, 0 where nothing is counted.
    """

    anchor: str
    title: str
    short: str
    count: int = 0

    @property
    def template(self) -> str:
        """Where its text is."""
        return f"sections/{self.anchor}.html.j2"


def sections(page: Page, pictures: Mapping[str, object]) -> tuple[Section, ...]:
    """Those that have something to say, in the order of the questions that people ask."""
    began = page.evidence or page.cause_note or page.failure_mode
    found = sum(len(group.rows) + group.more for group in page.findings)
    every = (
        (True, Section("when", "When it happened", "When")),
        (began, Section("cause", "What it began with", "Cause")),
        (True, Section("stops", "Where it stopped, and why", "Stops", _rows(page.stops))),
        (True, Section("findings", "Findings", "Findings", found)),
        (page.jumps.rows or page.trace_note,
         Section("jumps", "Which measurement moved the belief", "Jumps", _rows(page.jumps))),
        (page.usages.rows, Section("pose-age", "How old was the pose?", "Age")),
        (True, Section("covariance", "Is the covariance honest?", "Covariance")),
        (page.means.rows, Section("consistency", "Consistency", "Consistency")),
        (page.design.rows,
         Section("design", "What was changed, how much it took, and what broke first", "Doses")),
        (page.trials.rows, Section("trials", "Which evidence it depends on", "Trials")),
        (pictures["reliability"],
         Section("confidence", "What the confidence means", "Confidence")),
        (page.streams.rows, Section("audit", "Clocks and transforms", "Clocks, tf")),
        (page.missing or page.unasked or page.lacking,
         Section("lacking", "What cannot be judged", "Lacking")),
        (True, Section("basis", "What this rests on", "Sources")),
        (True, Section("ticket", "For a ticket", "Ticket")),
    )  # fmt: skip
    return tuple(section for told, section in every if told)


def _rows(table: Table) -> int:
    """How many a table tells of, those that it leaves to a file among them."""
    return len(table.rows) + table.more
