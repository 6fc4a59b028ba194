"""The consistency section's tables and words."""

from __future__ import annotations

from collections.abc import Iterator

from slamreplay.consistency.belief.summary import ConsistencySummary, PartSummary
from slamreplay.consistency.statistics.distribution import LEVELS
from slamreplay.report.cells import Cell, Table, table
from slamreplay.report.figures.consistency import drawn_parts
from slamreplay.report.phrases import NOT_KNOWN, number, p_value, short

Summaries = tuple[ConsistencySummary, ...]


def means(summaries: Summaries) -> Table:
    """The mean NEES of every part against every source, with its test."""
    head = ("held against", "part", "mean NEES", "95 % interval", "k", "updates", "independent",
            "p", "p after Holm")  # fmt: skip
    rows = [
        (
            _source(summary),
            part.name,
            Cell(short(part.mean.mean), f"{part.mean.dof} expected"),
            f"{short(part.mean.low)} to {short(part.mean.high)}",
            Cell(number(part.mean.ratio), _verdict(part)),
            f"{part.mean.n}",
            f"{part.mean.n_eff:.0f}",
            p_value(part.p_value),
            p_value(part.p_adjusted),
        )
        for summary, part in _rows(summaries)
    ]
    return table(head, rows, more_in="")


def coverage(summaries: Summaries) -> Table:
    """What the ellipses hold, the largest distance, and the credibility indices."""
    levels = tuple(f"{100 * level:.0f} %" for level in LEVELS)
    head = ("held against", "part", *levels, "distance D", "p of D", "NCI", "inclination")
    rows: list[tuple[str | Cell, ...]] = []
    for summary, part in _rows(summaries):
        found, index = part.distribution, part.index
        assert found is not None  # a part with a mean has a distribution
        rows.append(
            (
                _source(summary),
                part.name,
                *(f"{100 * share:.0f} %" for share in found.coverage),
                Cell(short(found.distance), f"{short(found.most)} by chance"),
                p_value(found.p_value),
                NOT_KNOWN if index is None else number(index.nci, ".1f", "dB"),
                NOT_KNOWN if index is None else number(index.inclination, "+.1f", "dB"),
            )
        )
    return table(head, rows, more_in="")


def note(summaries: Summaries) -> str:
    """How to read the section."""
    text = (
        "Of a consistent belief the mean NEES lies within its interval in 95 of 100 logs; k is the "
        "factor by which sigma is too small (below 1: too large). Updates of one log follow each "
        "other, so that they are worth the number of independent ones beside them. A finding needs "
        "p < 0.001 after Holm's correction over all tests of the log."
    )
    if any(summary.shared for summary in summaries):
        text += (
            " What shares evidence with the belief accuses it of gross over-confidence only, and "
            "never clears it."
        )
    if any(summary.at_most and not summary.shared for summary in summaries):
        text += (
            " A bound is a source whose own errors are known at most: it may show that sigma is "
            "too small, by the factor at least, and never that it is right or too large."
        )
    return text


def coverage_note(summaries: Summaries) -> str:
    """How to read the table of coverage."""
    text = (
        "D is the largest distance between claimed and held share over all ellipses, with what 5 % "
        "of consistent beliefs exceed by chance. NCI is the noncredibility index, 0 dB of a right "
        "covariance, and the inclination its side: above 0 dB sigma is too small, below too large, "
        "6 dB by a factor of 2. The actual mean square error is taken from the same errors."
    )
    return text if summaries else ""


def alt(summaries: Summaries) -> str:
    """The figure in words."""
    drawn = drawn_parts(summaries)
    if not drawn:
        return ""
    held = "; ".join(
        f"{name}: "
        + ", ".join(
            f"{100 * share:.0f} % within the {100 * level:.0f} % ellipse"
            for level, share in zip(LEVELS, found.coverage, strict=True)
        )
        for name, found in drawn
    )
    return (
        "Histogram of the distribution function at the errors, flat where the covariance is right, "
        f"and the share of errors that each ellipse holds, against {summaries[0].source}. {held}."
    )


def _rows(summaries: Summaries) -> Iterator[tuple[ConsistencySummary, PartSummary]]:
    for summary in summaries:
        for part in summary.parts:
            if part.mean.n:
                yield summary, part


def _source(summary: ConsistencySummary) -> Cell:
    if summary.shared:
        return Cell(summary.source, "shares its evidence")
    return Cell(summary.source, "independent, a bound" if summary.at_most else "independent")


def _verdict(part: PartSummary) -> str:
    return "" if part.mean.sufficient else "too few to judge"
