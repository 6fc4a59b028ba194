"""Marks on a scene's time axis: what the verdict found, what was done, and what jumped."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from slamreplay.bundle.findings import Severity
from slamreplay.bundle.view import BundleView
from slamreplay.estimators import RECORDED
from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.scene import Mark, MarkKind
from slamreplay.evidence.words import STATES
from slamreplay.geometry import se3
from slamreplay.verdict.judgement import Interval

#: Marks at one moment stand in this order.
_ORDER: tuple[MarkKind, ...] = (
    "lost", "map_changed", "stop", "recovery", "jump", "start", "finding",
)  # fmt: skip


def scene_marks(post: Postmortem, view: BundleView) -> tuple[Mark, ...]:
    """All marks by time."""
    found = [
        *_stretches(post, "lost", lambda interval: interval.is_lost),
        *_stretches(post, "map_changed", lambda interval: interval.is_changed),
        *(
            Mark("stop", stop.t_ns, None, f"Stop: {stop.cause}", "warning")
            for stop in post.judgement.stops
        ),
        *_recoveries(post),
        *_jumps(post),
        *_starts(view),
        *_findings(post),
    ]
    return tuple(sorted(found, key=lambda m: (m.t_ns, _ORDER.index(m.kind), m.title)))


def _stretches(
    post: Postmortem, kind: MarkKind, holds: Callable[[Interval], bool]
) -> Iterator[Mark]:
    """Stretches in which it holds; intervals that follow each other make one."""
    start_ns: int | None = None
    end_ns = 0
    for interval in post.judgement.intervals:
        if start_ns is not None and not (holds(interval) and interval.start_ns == end_ns):
            yield Mark(kind, start_ns, end_ns, STATES[kind].name, "error")
            start_ns = None
        if holds(interval):
            start_ns, end_ns = interval.start_ns if start_ns is None else start_ns, interval.end_ns
    if start_ns is not None:
        yield Mark(kind, start_ns, end_ns, STATES[kind].name, "error")


def _recoveries(post: Postmortem) -> Iterator[Mark]:
    for action in post.judgement.actions:
        if action.kind == "recovery":
            told = " (inferred)" if action.inferred else ", needless" if action.needless else ""
            severity: Severity = "warning" if action.allowed is False else "info"
            yield Mark("recovery", action.t_ns, None, f"Recovery: {action.name}{told}", severity)


def _jumps(post: Postmortem) -> Iterator[Mark]:
    """Those of the localizer that was recorded, as a planner read it."""
    jumps = next((jumps for trial, jumps in post.jumps if trial.estimator in RECORDED), ())
    for jump in jumps:
        size = f"{jump.step.metres:.2f} m, {np.degrees(jump.step.radians):.0f} deg"
        severity: Severity = "warning" if jump.step.is_grave and not jump.is_given else "info"
        yield Mark("jump", jump.step.t_ns, None, f"Jump by {size}: {jump.cause}", severity)


def _starts(view: BundleView) -> Iterator[Mark]:
    table = view.table("initial_poses").sorted_by_time()
    yaw = np.degrees(se3.yaw_from_quaternion(table["orientation_xyzw"])) if len(table) else ()
    for k, (t_ns, xyz) in enumerate(zip(table.t_ns.tolist(), table["position_xyz"], strict=True)):
        place = f"x {xyz[0]:.2f} m, y {xyz[1]:.2f} m, {yaw[k]:.0f} deg"
        yield Mark("start", t_ns, None, f"Initial pose: {place}", "info")


def _findings(post: Postmortem) -> Iterator[Mark]:
    for finding in post.findings:
        if finding.start_ns is None or finding.severity == "info":
            continue
        lasts = finding.end_ns is not None and finding.end_ns > finding.start_ns
        yield Mark(
            "finding",
            finding.start_ns,
            finding.end_ns if lasts else None,
            f"{finding.id}: {finding.title}",
            finding.severity,
        )
