"""A report in a few lines, as a notebook or a terminal shows it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from slamreplay.evidence.clean import as_markdown, clean
from slamreplay.evidence.words import STATES, confidence_text
from slamreplay.notebook import markup

if TYPE_CHECKING:
    from slamreplay.evidence.result import Postmortem
    from slamreplay.report.model import Report


def lines_of(report: Report, post: Postmortem | None) -> list[tuple[str, str, str]]:
    """Label, text and tone; of a report from its file, without a post-mortem, the verdict alone."""
    if post is None:
        verdict, bundle = report.verdict, report.bundle
        sure = (
            ""
            if verdict.confidence is None
            else f"confidence {confidence_text(verdict.confidence)}"
        )
        worst = [f"{f.id} {f.title}" for f in report.findings if f.severity == "error"]
        return [
            (verdict.state, sure, "plain"),
            ("in short", verdict.summary, "plain"),
            ("findings", "; ".join(worst) or "no error", "plain"),
            ("missing", ", ".join(bundle.missing) or "none of the eight parts", "quiet"),
        ]
    from slamreplay.report.summary import summary_lines

    return [(line.label, line.text, line.tone) for line in summary_lines(post)]


def plain(report: Report, post: Postmortem | None) -> str:
    """One line each."""
    rows = lines_of(report, post)
    width = max(len(label) for label, *_ in rows)
    head = f"<Report {', '.join(report.bundle.sources)}>"
    return clean("\n".join([head, *(f"{label:<{width}}  {text}" for label, text, _ in rows)]))


def markdown(report: Report, post: Postmortem | None) -> str:
    """The same for a ticket; what came from a log is no markup."""
    (state, sure, _), *rows = lines_of(report, post)
    sources = ", ".join(report.bundle.sources)
    head = f"**{as_markdown(state)}**: {as_markdown(sure)} ({as_markdown(sources)})"
    told = [f"- **{as_markdown(label)}**: {as_markdown(text)}" for label, text, _ in rows]
    return clean("\n".join([head, "", *told]))


def html(report: Report, post: Postmortem | None) -> str:
    """The verdict, what decided it, and the map with both paths."""
    (_, sure, tone), (_, summary, _), *rows = lines_of(report, post)
    log = "log", ", ".join(report.bundle.sources)
    parts = [
        markup.heading(STATES[report.verdict.state].name, sure, tone),
        markup.paragraph(summary),
        markup.grid((), [*((label, text) for label, text, _ in rows), log]),
    ]
    if post is not None:
        parts.append(_map(post))
    return markup.box(*parts)


def _map(post: Postmortem) -> str:
    from slamreplay.report.figures import canvas
    from slamreplay.report.figures.panels import PANELS, caption

    with canvas.plain_style():
        figure = PANELS["map"].figure(post, canvas.BESIDE)
        if figure is None:
            return markup.paragraph("No path is known.")
        return markup.picture(canvas.svg_bytes(figure), caption(PANELS["map"], post))
