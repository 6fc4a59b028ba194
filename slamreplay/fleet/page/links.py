"""Links from the fleet's page into the reports that lie beside it."""

from __future__ import annotations

from dataclasses import dataclass
from urllib.parse import quote

from slamreplay.fleet.answers import Answers


@dataclass(frozen=True)
class Link:
    """A text and where it leads; without an address it is text alone."""

    text: str
    href: str = ""


@dataclass(frozen=True)
class Reports:
    """Where each log's report is, as answers know it."""

    answers: Answers

    def of(self, key: str, text: str = "") -> Link:
        """A log's report, where its first trouble begins; the log's short name by default."""
        log, folder = self.answers.logs.get(key, ("", None))
        return self.to(key, text or short_name(log), folder)

    def to(self, key: str, text: str, folder: str | None) -> Link:
        """The report in a folder."""
        if not folder:
            return Link(text)
        at = self.answers.troubles_s.get(key)
        # As the report's own links have it: seconds from the log's start.
        moment = "" if at is None else f"#t={at:.2f}".rstrip("0").rstrip(".")
        return Link(text, f"{quote(folder)}/report.html{moment}")


def short_name(log: str) -> str:
    """The last part of a log's address."""
    return log.rstrip("/\\").replace("\\", "/").rsplit("/", 1)[-1]
