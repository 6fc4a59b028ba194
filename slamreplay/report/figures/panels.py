"""The panels of a report by name: what each draws, how wide it is on paper, and its caption."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from slamreplay.evidence.result import Postmortem
from slamreplay.report.designs import design_of
from slamreplay.report.dose_tables import words_of
from slamreplay.report.figures import captions
from slamreplay.report.figures.canvas import COLUMN, PAGE, Part
from slamreplay.report.figures.consistency import consistency_figure, consistency_parts
from slamreplay.report.figures.course import course_figure, course_parts
from slamreplay.report.figures.covariance import covariance_figure, covariance_parts
from slamreplay.report.figures.doses import dose_parts, doses_figure
from slamreplay.report.figures.graph import graph_figure, graph_parts
from slamreplay.report.figures.map import map_figure, map_parts
from slamreplay.report.figures.reliability import reliability_figure, reliability_parts
from slamreplay.report.figures.root_cause import cause_figure, cause_parts


@dataclass(frozen=True)
class Panel:
    """One figure of a report.

    Attributes:
        name: of its files.
        title: in a few words.
        width_in: of the paper it is made for, to be set without scaling: a column where its axes
            stand alone or below each other, the page where they stand side by side.
        parts: its axes one by one, for other arrangements; empty where this log has none.
        figure: all of it on paper of a width in inches; None where this log has none.
        caption: one paragraph, without the log's name; only of a log that has the figure.
    """

    name: str
    title: str
    width_in: float
    parts: Callable[[Postmortem], tuple[Part, ...]]
    figure: Callable[[Postmortem, float], Figure | None]
    caption: Callable[[Postmortem], str]


def _consistency(post: Postmortem, width_in: float) -> Figure | None:
    return consistency_figure(post.consistency, width_in)


def _doses(post: Postmortem, width_in: float) -> Figure | None:
    results = design_of(post)
    if results is None or not _dose_parts(post):
        return None
    return doses_figure(results, words_of(results), width_in)


def _dose_parts(post: Postmortem) -> tuple[Part, ...]:
    results = design_of(post)
    if results is None or not any(curve.responses for curve in results.curves):
        return ()
    return dose_parts(results, words_of(results))


def _graph(post: Postmortem, width_in: float) -> Figure | None:
    return None if post.slam is None else graph_figure(post.slam, width_in)


def _reliability(post: Postmortem, width_in: float) -> Figure | None:
    return reliability_figure(post.reliability, width_in, post.judgement.confidence)


def _reliability_parts(post: Postmortem) -> tuple[Part, ...]:
    return reliability_parts(post.reliability, post.judgement.confidence)


_EVERY = (
    Panel("map", "Map with both paths", COLUMN, map_parts, map_figure, captions.map_caption),
    Panel("course", "Course of the log", COLUMN, course_parts, course_figure,
          captions.course_caption),
    Panel("root_cause", "Root cause", COLUMN, cause_parts, cause_figure, captions.cause_caption),
    Panel("covariance", "Covariance against error", PAGE, covariance_parts, covariance_figure,
          captions.covariance_caption),
    Panel("consistency", "Consistency", PAGE, lambda post: consistency_parts(post.consistency),
          _consistency, captions.consistency_caption),
    Panel("doses", "Dose and response", PAGE, _dose_parts, _doses, captions.doses_caption),
    Panel("graph", "Map of the pose graph", COLUMN, graph_parts, _graph, captions.graph_caption),
    Panel("reliability", "Reliability of the confidence", COLUMN, _reliability_parts, _reliability,
          captions.reliability_caption),
)  # fmt: skip

#: In the order in which a report has them.
PANELS = {panel.name: panel for panel in _EVERY}


def caption(panel: Panel, post: Postmortem) -> str:
    """The whole caption of a panel that the log has, with the log's name and the bundle's id."""
    told = f"{panel.caption(post)} {captions.provenance(post)}"
    return " ".join(told.split())
