"""Recorded logs with faults put into them: a row of what was injected and what was found.

The truth is the trajectory that hindsight finds in the log as it was recorded, where it is
credible: the fault is put in afterwards and shares nothing with it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bench import inject
from slamreplay.bench.injection import Box, Injection
from slamreplay.bench.moments import Score, scored, true_lost, within
from slamreplay.bench.real_faults import FAULTS, Flags, Recorded, edited_beams
from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.view import BundleView
from slamreplay.errors import UsageError
from slamreplay.geometry.times import NS_PER_S, ns
from slamreplay.simulate.truth import in_stretches
from slamreplay.verdict.judgement import Judgement
from slamreplay.verdict.limits import Limits

#: Hindsight that knows less of a log, or whose scans fit worse, is no truth to build on.
_LEAST_COVERAGE, _LEAST_MATCH = 0.9, 0.7


@dataclass(frozen=True)
class Row:
    """One injection: what was done, what was true, what was found.

    Attributes:
        what: the fault in words.
        lost_s: how long the robot was lost, by truth and by the verdict.
        changed_s: how long the map was contradicted, by truth and by the verdict.
        lost: scores per moment.
        changed: scores per moment.
        state: of the log.
        mode: failure mode.
        region: whether a changed region lies at the edited place, None where nothing was edited.
        delay_s: from the first moment truly lost or changed to the first one found.
    """

    what: str
    lost_s: tuple[float, float]
    changed_s: tuple[float, float]
    lost: Score
    changed: Score
    state: str
    mode: str
    region: bool | None
    delay_s: float | None


def recorded(view: BundleView) -> Recorded:
    """The log to put faults into.

    Raises:
        UsageError: hindsight does not know well enough where the robot was in it.
    """
    from slamreplay.hindsight.pipeline import hindsight

    found = hindsight(view)
    scans = scan_set(view)
    if found is None or scans is None or found.changes is None:
        raise UsageError("scans and a map are needed")
    match = float(np.nanmedian(found.match)) if found.coverage else 0.0
    if found.coverage < _LEAST_COVERAGE or match < _LEAST_MATCH:
        text = f"hindsight knows {found.coverage:.0%} of it with a match of {match:.2f}"
        raise UsageError(f"no trajectory to take as true: {text}")
    told = inject.with_localizer(view, found.track)
    judged = _judged(told, found)
    t_ns = scans.t_ns
    track = found.track.at(t_ns)
    share = np.interp(t_ns, found.changes.t_ns, np.nan_to_num(found.changes.changed_share))
    own = within(judged, t_ns, "is_changed")
    return Recorded(told, t_ns, track.xyyaw, scans, np.asarray(share), own)


def table(
    log: Recorded, seeds: Sequence[int] = (0,), skipped: Callable[[str], object] = str
) -> Iterator[Row]:
    """A row for the log as it is, and one for each fault that fits into it.

    Args:
        log: from `recorded`.
        seeds: one set of faults for each.
        skipped: told which fault does not fit, and why.
    """
    yield row("nothing", Injection("none", log.view, log.view.manifest.start_ns), log)
    for seed in seeds:
        rng = np.random.Generator(np.random.PCG64(seed))
        for make in FAULTS:
            try:
                what, injection = make(log, rng)
            except UsageError as error:
                skipped(f"{make.__name__} left out: {error}")
                continue
            yield row(what, injection, log)


def _judged(view: BundleView, found: Hindsight | None) -> Judgement:
    from slamreplay.verdict.judge import judge

    if found is None:
        raise UsageError("scans and a map are needed")
    return judge(view, recorded_belief(view, found.track.t_ns), found)


def row(what: str, injection: Injection, log: Recorded) -> Row:
    """One injection judged and held against its truth."""
    from slamreplay.hindsight.pipeline import hindsight

    view = injection.view
    found = hindsight(view)
    judged = _judged(view, found)
    scans = scan_set(view)
    if scans is None or found is None:
        raise UsageError("scans and a map are needed")
    t_ns = scans.t_ns
    index = np.searchsorted(log.track_ns, injection.recorded_ns(t_ns))
    index = np.minimum(index, len(log.track_ns) - 1)
    true = log.xyyaw[index]
    lost, changed = true_lost(view, t_ns, true), _true_changed(injection, log, index)
    known = np.asarray(np.isfinite(true).all(axis=1))
    said_lost, said_changed = (within(judged, t_ns, k) for k in ("is_lost", "is_changed"))
    mixed = log.own[index]  # what the room itself contradicts is neither right nor wrong here
    first = [np.flatnonzero(f) for f in (lost | changed, (said_lost | said_changed) & ~mixed)]
    delay = (t_ns[first[1][0]] - t_ns[first[0][0]]) / NS_PER_S if all(map(len, first)) else None
    regions = found.changes.regions if found.changes is not None else ()
    boxes = [b for b in (injection.box_m, injection.from_box_m) if b is not None]
    at_place = any(_overlap(r.bbox_m, b) for r in regions for b in boxes)
    step = float(np.median(np.diff(t_ns))) / NS_PER_S
    return Row(
        what,
        (float(lost.sum() * step), float(said_lost.sum() * step)),
        (float(changed.sum() * step), float(said_changed.sum() * step)),
        scored(t_ns, lost, said_lost, known),
        scored(t_ns, changed, said_changed, known & ~mixed),
        judged.state,
        judged.failure_mode.kind,
        at_place if boxes else None,
        None if delay is None else float(delay),
    )


def _true_changed(injection: Injection, log: Recorded, index: NDArray[np.int64]) -> Flags:
    """(M,) whether more beams than allowed contradict the edited map, by definition."""
    limits = Limits()
    t_ns = log.track_ns[index]
    if injection.box_m is None or injection.view.grid is None:
        return np.zeros(len(index), dtype=bool)
    beams = edited_beams(injection, log)
    share = beams[index] + log.share[index]
    flags = (share > limits.changed_share) & (beams[index] > 0.0)
    return in_stretches(t_ns, flags, ns(limits.changed_s), ns(limits.bridge_s))


def _overlap(a: Box, b: Box) -> bool:
    return a[0] <= b[2] and b[0] <= a[2] and a[1] <= b[3] and b[1] <= a[3]
