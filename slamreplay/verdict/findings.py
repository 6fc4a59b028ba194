"""The findings that made the verdict."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slamreplay.bundle.findings import SEVERITIES, Finding, Severity
from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry.times import NS_PER_S
from slamreplay.verdict.intervals import episodes
from slamreplay.verdict.judgement import ConstantOffset, Interval
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.map_fit import MapFit
from slamreplay.verdict.timing import Delay
from slamreplay.verdict.wheels import LEAST_M, Wheels

#: A delay of this size makes a robot misplace walls by a cell and more.
LATE_S = 0.1


def verdict_findings(
    view: BundleView,
    belief: PoseTrack | None,
    hindsight: Hindsight | None,
    intervals: Sequence[Interval],
    offset: ConstantOffset | None,
    limits: Limits,
    fit: MapFit | None = None,
) -> tuple[Finding, ...]:
    """Worst first; within a severity in time order."""
    span = (view.manifest.start_ns, view.manifest.end_ns)
    found: list[Finding] = []
    if belief is None:
        text = "no localizer spoke: whether the robot was lost is not judged"
        found.append(Finding("SR-LOC-003", "warning", text, *span))
    if view.grid is None:
        text = "no map in the log and none given: nothing can be judged against it"
        found.append(Finding("SR-MAP-002", "warning", text, *span))
    found += [_lost(e, view, limits) for e in episodes(intervals, lambda i: i.is_lost)]
    found += [_changed(e, hindsight, limits) for e in episodes(intervals, lambda i: i.is_changed)]
    if hindsight is not None:
        found += _unobservable(intervals, hindsight, limits)
    found += _wrong_map(fit, limits, view.span)
    found += _offset(offset, view.span)
    found += _unjudged(intervals, span)
    return tuple(sorted(found, key=lambda f: (-SEVERITIES.index(f.severity), f.start_ns or 0)))


def _lost(i: Interval, view: BundleView, limits: Limits) -> Finding:
    metres, degrees = i.max_error_m or 0.0, np.degrees(i.max_error_rad or 0.0)
    since = (i.start_ns - view.manifest.start_ns) / NS_PER_S
    text = (
        f"lost for {i.duration_ns / NS_PER_S:.1f} s from {since:.1f} s on: the belief was up to "
        f"{metres:.2f} m and {degrees:.0f} deg from where the robot really was"
    )
    by_heading = metres <= limits.position_m
    return Finding(
        "SR-LOC-001",
        "error",
        text,
        i.start_ns,
        i.end_ns,
        value=i.max_error_rad if by_heading else i.max_error_m,
        low=0.0,
        high=limits.yaw_rad if by_heading else limits.position_m,
        unit="rad" if by_heading else "m",
    )


def _changed(i: Interval, hindsight: Hindsight | None, limits: Limits) -> Finding:
    changes = None if hindsight is None else hindsight.changes
    share = np.empty(0)
    if changes is not None:
        inside = (changes.t_ns >= i.start_ns) & (changes.t_ns < i.end_ns)
        share = changes.changed_share[inside & np.isfinite(changes.changed_share)]
    most = float(share.max()) if len(share) else None
    text = (
        f"for {i.duration_ns / NS_PER_S:.1f} s up to {100 * (most or 0.0):.0f} % of the beams "
        f"contradict the map where {100 * limits.changed_share:.0f} % are allowed"
    )
    return Finding(
        "SR-MAP-001",
        "warning",
        text,
        i.start_ns,
        i.end_ns,
        value=most,
        low=0.0,
        high=limits.changed_share,
        unit="ratio",
        n=len(share),
    )


def _unobservable(
    intervals: Sequence[Interval], hindsight: Hindsight, limits: Limits
) -> list[Finding]:
    found = [i for i in intervals if i.state == "unobservable"]
    if not found:
        return []
    if hindsight.margin is None or hindsight.margin >= limits.margin:
        return [_lookalike(i, hindsight, limits) for i in found]
    text = (
        f"the best sequence of places beats the best different one by {hindsight.margin:.4f} in "
        f"mean score per scan; less than {limits.margin:g} is within the noise"
    )
    start, end = found[0].start_ns, found[-1].end_ns
    return [
        Finding(
            "SR-LOC-002", "warning", text, start, end, value=hindsight.margin, low=limits.margin
        )
    ]


def _lookalike(i: Interval, hindsight: Hindsight, limits: Limits) -> Finding:
    """A stretch of a log that is placed for the rest."""
    t_ns = hindsight.track.t_ns
    lead = hindsight.lead[(t_ns >= i.start_ns) & (t_ns < i.end_ns)]
    least = float(lead.min())
    text = (
        f"for {i.duration_ns / NS_PER_S:.1f} s another place explains the scans as well: the best "
        f"one leads by {least:.3f} in mean score; less than {limits.lead:g} is within the noise"
    )
    return Finding(
        "SR-LOC-002", "warning", text, i.start_ns, i.end_ns, value=least, low=limits.lead
    )


def _wrong_map(fit: MapFit | None, limits: Limits, span: tuple[int, int]) -> list[Finding]:
    if fit is None or fit.fits:
        return []
    text = f"the scans fit nowhere in this map: {fit.text}"
    return [
        Finding(
            "SR-MAP-WRONG",
            "error",
            text,
            *span,
            value=fit.typical,
            low=limits.fits_well_from,
            high=1.0,
            unit="1",
        )
    ]


def _offset(offset: ConstantOffset | None, span: tuple[int, int]) -> list[Finding]:
    if offset is None or offset.cause == "lookalike":
        return []
    severity: Severity = "error" if offset.cause == "map" else "warning"
    text = f"belief and map differ by one constant transform over the whole log: {offset.text}"
    if offset.cause == "map_or_start":
        text += "; a wrong start that was never corrected explains it equally well"
    return [
        Finding(
            "SR-MAP-FRAME", severity, text, *span, value=offset.at_robot_m, low=0.0, high=0.0,
            unit="m",
        )
    ]  # fmt: skip


def motion_findings(
    view: BundleView, delay: Delay | None, turned: Wheels | None
) -> tuple[Finding, ...]:
    """SR-CLK-002 and SR-ODO-001: what the clocks and the wheels did to the log."""
    span = view.span
    found: list[Finding] = []
    if delay is not None and delay.is_significant:
        low, high = (delay.seconds + k * 2.0 * delay.sigma_s for k in (-1, 1))
        severity: Severity = "warning" if abs(delay.seconds) >= LATE_S else "info"
        found.append(
            Finding(
                "SR-CLK-002", severity, delay.text, *span, value=delay.seconds, low=low, high=high,
                unit="s", n=delay.turns,
            )
        )  # fmt: skip
    if turned is not None:
        for slip in turned.slips:
            text = slip.text(view.manifest.start_ns)
            found.append(
                Finding(
                    "SR-ODO-001", "warning", text, slip.start_ns, slip.end_ns, value=slip.metres,
                    low=0.0, high=LEAST_M, unit="m",
                )
            )  # fmt: skip
        found += [Finding("SR-ODO-002", "info", text, *span) for text in turned.calibration_words]
    return tuple(found)


def _unjudged(intervals: Sequence[Interval], span: tuple[int, int]) -> list[Finding]:
    unjudged = [i for i in intervals if "SR-LOC-004" in i.findings]
    if not unjudged:
        return []
    total = sum(i.duration_ns for i in unjudged)
    share = total / max(span[1] - span[0], 1)
    text = f"{total / NS_PER_S:.1f} s ({100 * share:.0f} % of the log) cannot be judged"
    severity: Severity = "warning" if share > 0.5 else "info"
    return [
        Finding(
            "SR-LOC-004", severity, text, unjudged[0].start_ns, unjudged[-1].end_ns, value=share,
            low=0.0, high=0.5, unit="ratio", n=len(unjudged),
        )
    ]  # fmt: skip
