"""A verdict with its evidence: what `sr.report` gives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slamreplay.errors import UsageError
from slamreplay.notebook.plotting import Plot

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from pydantic import BaseModel

    from slamreplay.bundle.track import PoseTrack
    from slamreplay.evidence.result import Postmortem
    from slamreplay.report.model import Report as Content
    from slamreplay.report.model import VerdictPart


@dataclass(frozen=True, eq=False, repr=False)
class Report:
    """The verdict on one log, and what it rests on.

    Tables are DataFrames, with times as ns (`..._ns`) and as seconds since the log's start
    (`..._s`), and units in `attrs["units"]`.

    Attributes:
        content: report.json as an object: every number of the tables stands in it.
        post: the post-mortem behind it; None of a report that was read from its file, which has
            tables but neither trajectories nor figures.
    """

    content: Content
    post: Postmortem | None = None

    @property
    def verdict(self) -> VerdictPart:
        """`state`, `confidence` (0 to 1, None where nothing was decided), `summary`, `lacking`."""
        return self.content.verdict

    @cached_property
    def intervals(self) -> pd.DataFrame:
        """Stretches of one state; they tile the log."""
        from slamreplay.report.model import IntervalPart

        return self._frame(self.content.intervals, IntervalPart)

    @cached_property
    def regions(self) -> pd.DataFrame:
        """Patches of the map that are not true."""
        from slamreplay.report.model import RegionPart

        return self._frame(self.content.changed_regions, RegionPart)

    @cached_property
    def findings(self) -> pd.DataFrame:
        """Answers of the checks, the worst first; `sr.explain(id)` says what one means."""
        from slamreplay.report.model import FindingPart

        return self._frame(self.content.findings, FindingPart)

    @cached_property
    def stops(self) -> pd.DataFrame:
        """Unplanned stops."""
        from slamreplay.report.model import StopPart

        return self._frame(self.content.stops, StopPart)

    @cached_property
    def actions(self) -> pd.DataFrame:
        """Recoveries and motions, and whether there was room for them."""
        from slamreplay.report.model import ActionPart

        return self._frame(self.content.actions, ActionPart)

    @cached_property
    def jumps(self) -> pd.DataFrame:
        """Steps of paths beyond what odometry tells, and their causes."""
        from slamreplay.report.model import JumpPart

        return self._frame(self.content.jumps, JumpPart)

    @cached_property
    def trials(self) -> pd.DataFrame:
        """Runs of estimators, a column for each number of them; the baselines first."""
        import pandas as pd

        from slamreplay.notebook.frames import with_units
        from slamreplay.report.model import TrialPart

        frame = self._frame(self.content.trials, TrialPart)
        metrics = frame.pop("metrics")
        for name in dict.fromkeys(name for row in metrics for name in row):
            kind = "boolean" if name == "not_applicable" else "float64"
            frame[name] = pd.Series([row.get(name) for row in metrics], dtype=kind)
        return with_units(frame)

    @cached_property
    def ledger(self) -> pd.DataFrame:
        """What the measurements of each source did to each run, in a few numbers."""
        from slamreplay.report.model import LedgerSourcePart

        return self._frame(self.content.ledger.sources, LedgerSourcePart)

    @cached_property
    def trace(self) -> pd.DataFrame:
        """Measurements around the moment that was asked for, by run, the strongest first."""
        from slamreplay.report.model import TraceRowPart

        runs = [] if self.content.trace is None else self.content.trace.runs
        frame = self._frame([row for run in runs for row in run.rows], TraceRowPart)
        whose = [(run.estimator, run.perturbation) for run in runs for _ in run.rows]
        for place, name in enumerate(("estimator", "perturbation")):
            frame.insert(place, name, [pair[place] for pair in whose])
        return frame

    @cached_property
    def root_cause(self) -> pd.DataFrame:
        """Causes that were tried, the most probable first; in `attrs` what it began as."""
        from slamreplay.report.model import CandidatePart

        cause = self.content.root_cause
        frame = self._frame([] if cause is None else cause.candidates, CandidatePart)
        if cause is not None:
            frame.attrs |= {"began_as": cause.began_as, "probability": cause.probability,
                            "trials": cause.trials, "reason": cause.reason}  # fmt: skip
        return frame

    @property
    def belief(self) -> pd.DataFrame:
        """What the robot believed: a row a scan; none where no localizer spoke."""
        return self._track(self._whole("belief").belief)

    @property
    def hindsight(self) -> pd.DataFrame:
        """Where it really was: a row a scan; none where that cannot be rebuilt."""
        found = self._whole("hindsight").hindsight
        return self._track(None if found is None else found.track)

    @property
    def lanes(self) -> pd.DataFrame:
        """Error, sigma, NEES, changed beams and match over time: a row a value."""
        from slamreplay.evidence.scene_lanes import scene_lanes
        from slamreplay.notebook.frames import lanes_frame

        post = self._whole("lanes")
        lanes = scene_lanes(post) if post.scene is None else post.scene.lanes
        return lanes_frame(lanes, self._start_ns)

    @property
    def figures(self) -> list[str]:
        """Names of the figures that this log has: panels, then single axes of panels."""
        if self.post is None:
            return []
        from slamreplay.notebook.plotting import names_of

        return names_of(self.post)

    def figure(self, name: str, ax: Any = None, *, width_in: float | None = None) -> Any:
        """Draw a figure of the report.

        Args:
            name: one of `figures`.
            ax: matplotlib axes to draw in, as many as the figure has; by default a new figure.
            width_in: of a new figure, inches.

        Returns:
            The axes, or an array of them where the figure has several.

        Raises:
            UsageError: there is no such figure, the axes do not fit, or the report was read from
                its file.
            NotApplicableError: this log does not have it.
        """
        from slamreplay.notebook.plotting import draw

        return draw(self._whole("figures"), name, ax, width_in)

    @property
    def plot(self) -> Plot:
        """The same by name: `report.plot.map()`, `report.plot.course(ax=axes)`."""
        return Plot(self)

    def caption(self, name: str) -> str:
        """What stands under a figure in a paper or a ticket.

        Raises:
            UsageError: no panel of this log has that name.
        """
        from slamreplay.registry import nearest
        from slamreplay.report.figures.panels import PANELS, caption

        post = self._whole("captions")
        there = [n for n, panel in PANELS.items() if panel.parts(post)]
        if name not in there:
            raise UsageError(f"there is no figure '{name}'", hint=nearest(name, there))
        return caption(PANELS[name], post)

    def save(self, folder: str | Path, *, figures: str | Path | None = None) -> Path:
        """Write report.html, report.json and their kin, as `slamreplay report -o` does.

        Args:
            folder: a report of ours that is there already is replaced in one step.
            figures: folder for each figure as PNG and SVG with captions.

        Returns:
            The path of report.html.

        Raises:
            OutputError: a folder is somebody else's or cannot be written.
            UsageError: the report was read from its file.
        """
        from slamreplay.report.figure_files import check_figures_target, write_figures
        from slamreplay.report.writer import write_report

        post = self._whole("pages")
        if figures is not None:
            check_figures_target(Path(figures), Path(folder))
        page = write_report(post, Path(folder))
        if figures is not None:
            write_figures(post, Path(figures))
        return page

    def json(self) -> dict[str, Any]:
        """report.json as plain values."""
        return self.content.model_dump(mode="json")

    def __repr__(self) -> str:
        from slamreplay.notebook.report_text import plain

        return plain(self.content, self.post)

    def _repr_html_(self) -> str:
        from slamreplay.notebook.report_text import html

        return html(self.content, self.post)

    def _repr_markdown_(self) -> str:
        from slamreplay.notebook.report_text import markdown

        return markdown(self.content, self.post)

    @property
    def _start_ns(self) -> int:
        return self.content.bundle.start_ns

    def _whole(self, what: str) -> Postmortem:
        if self.post is None:
            raise UsageError(
                f"a report that was read from its file has no {what}",
                where="report.json",
                hint="make it of its log again, with sr.report",
            )
        return self.post

    def _frame(self, parts: Sequence[BaseModel], kind: type[BaseModel]) -> pd.DataFrame:
        from slamreplay.notebook.frames import parts_frame

        return parts_frame(parts, kind, self._start_ns)

    def _track(self, track: PoseTrack | None) -> pd.DataFrame:
        import numpy as np

        from slamreplay.bundle.track import PoseTrack
        from slamreplay.notebook.frames import track_frame

        if track is None:
            nothing = np.empty(0, dtype=np.int64), np.empty((0, 3))
            track = PoseTrack.without_covariance("", "", *nothing)
        return track_frame(track, self._start_ns)
