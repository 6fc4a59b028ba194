"""Look back on a log: `sr.report`."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from slamreplay.notebook.evidence import Evidence, found
from slamreplay.notebook.progress import Progress, shown
from slamreplay.notebook.report_value import Report


def report(
    evidence: Evidence,
    *,
    map: str | Path | None = None,  # noqa: A002 - as the command line has it
    topics: str | Path | None = None,
    robot: str | None = None,
    reference: str | Path | None = None,
    start: float | None = None,
    end: float | None = None,
    hold_out: Collection[str] = (),
    cause: bool = True,
    trace: float | None = None,
    output: str | Path | None = None,
    progress: Progress | bool | None = None,
) -> Report:
    """Say whether the robot was lost or the map had changed, with the evidence.

    Args:
        evidence: what `sr.ingest`, `sr.perturb` or `sr.open` gave, or the path of a log, of a
            bundle or of runs.
        map: of a raw log: map_server yaml that was driven on.
        topics: of a raw log: yaml of `role: topic`.
        robot: of a raw log: namespace or number of the robot to look at.
        reference: of a raw log: poses that judge, as TUM or CSV, or relations.
        start: of a raw log: leave out what is earlier, s from its start.
        end: of a raw log: leave out what is later, s from its start.
        hold_out: kinds of sensed references (fiducial, dock, gnss) that judge hindsight instead of
            joining it.
        cause: replay what went wrong with one thing put right at a time, to name its root cause.
        trace: tell which measurements moved the belief around this moment, s from the start.
        output: also write the report here, as `slamreplay report -o` does.
        progress: told how far it is; True draws a line, False nothing.

    Raises:
        SlamreplayError: what is wrong, where, and what can be done about it, in one line.

    >>> import slamreplay as sr
    >>> r = sr.report("sample_logs/healthy_short.bag")
    >>> r.verdict.state, r.verdict.confidence > 0.9
    ('healthy', True)
    >>> r.intervals[["state", "start_s", "end_s"]].round(1).values.tolist()
    [['healthy', 0.0, 18.8]]
    >>> axes = r.figure("map")
    >>> axes.get_xlabel()
    'x in map [m]'
    """
    from slamreplay.bundle.atomic import check_target
    from slamreplay.bundle.view import check_held_out
    from slamreplay.evidence.trace import trace_time
    from slamreplay.postmortem import postmortem
    from slamreplay.report import REPORT_FILE
    from slamreplay.report.build import build
    from slamreplay.report.writer import write_report

    check_held_out(hold_out)
    if output is not None:
        check_target(Path(output), REPORT_FILE, "output=")
    options = {"map": map, "topics": topics, "robot": robot, "reference": reference,
               "start": start, "end": end}  # fmt: skip
    of = found(evidence, options, progress)
    manifest = of.log.manifest
    trace_ns = None if trace is None else trace_time(trace, manifest.start_ns, manifest.end_ns)
    with shown(progress) as tell:
        post = postmortem(
            of.log.bundle,
            of.runs,
            hold_out=hold_out,
            trace_ns=trace_ns,
            design=of.design,
            cause=cause,
            progress=tell,
        )
    if output is not None:
        write_report(post, Path(output))
    return Report(build(post), post)
