"""One case: made, looked back on, judged, and written down moment by moment beside its truth."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, grey_closing, grey_opening

from slamreplay.bench.baselines import FIELD_THRESHOLDS, baseline_scores
from slamreplay.bench.incidents import Incident, incident
from slamreplay.bench.logs import bundle_of
from slamreplay.bench.schedule import Case
from slamreplay.bench.truth import Truth, changed_cells
from slamreplay.bundle.belief import belief_times, recorded_belief
from slamreplay.bundle.products import ChangedRegion, Hindsight
from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.consistency.statistics.whitening import whitened
from slamreplay.geometry import se2
from slamreplay.geometry.times import ns
from slamreplay.hindsight.pipeline import hindsight
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.verdict.judge import judge
from slamreplay.verdict.judgement import Judgement
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.tiles import gathered
from slamreplay.verdict.timing import scan_delay

#: A change counts as there to be found from here on; around it nothing is called false, m.
_SEEN_S, _AROUND_M, _TOUCH_M = 4.0, 0.3, 0.15
#: Times between which a level is held.
_STEP_S = 0.05
#: A scan of another laser says what holds for so long.
_NEAR_S = 0.15


@dataclass(frozen=True, eq=False)
class Measured:
    """One judged log: `moments` are arrays (N,), `facts` what is said once; see `measured`."""

    case: Case
    facts: dict[str, Any]
    moments: dict[str, NDArray] = field(default_factory=dict)


def measured(case: Case) -> Measured:
    """Play a case through all stages.

    Moments: t_s; lost, changed by truth; judged_lost, judged_changed; unjudged; confidence of the
    interval; error_m, error_rad, nees_xy, nees_yaw of hindsight; ratio (how far and long the belief
    is from hindsight, in limits of lost); changed_share by truth and by hindsight; the baselines'
    scores.
    """
    made = incident(case.kind, case.seed, case.conditions)
    bundle, truth = bundle_of(made)
    view = bundle.view()
    found = hindsight(view)
    belief = recorded_belief(view, belief_times(view))
    judgement = judge(view, belief, found)
    moments = {
        "t_s": (truth.t_ns - truth.t_ns[0]) / 1e9,
        "lost": truth.lost,
        "changed": truth.changed,
        "true_share": truth.changed_share,
        **_judged(judgement, truth.t_ns),
        **_hindsight_error(found, truth),
        **_ratio(view, found, belief, truth.t_ns),
    }
    laser = scan_set(view)
    for name, scores in baseline_scores(view).items():
        at = np.full(len(truth.t_ns), np.nan)
        if laser is not None and len(laser):  # of two lasers it may be the other one
            row = _latest(laser.t_ns, truth.t_ns)
            is_near = np.abs(truth.t_ns - laser.t_ns[row]) <= ns(_NEAR_S)
            at = np.where(is_near, scores[row], np.nan)
        moments[name] = at
    assert set(FIELD_THRESHOLDS) <= set(moments)
    facts = {
        "state": truth.state,
        "judged": judgement.state,
        "confidence": judgement.confidence,
        "failure_mode": judgement.failure_mode.kind,
        "findings": sorted({f.id for f in judgement.findings}),
        "coverage": None if found is None else found.coverage,
        "margin": None if found is None else found.margin,
        **_regions(made, truth, found, view.grid),
    }
    return Measured(case, facts, moments)


def _judged(judgement: Judgement, t_ns: NDArray[np.int64]) -> dict[str, NDArray]:
    """What the intervals say at each moment."""
    starts = np.array([i.start_ns for i in judgement.intervals])
    row = np.clip(np.searchsorted(starts, t_ns, side="right") - 1, 0, None)
    unjudged = ("unobservable", "insufficient_data")
    values = {
        "judged_lost": [i.is_lost for i in judgement.intervals],
        "judged_changed": [i.is_changed for i in judgement.intervals],
        "unjudged": [i.state in unjudged for i in judgement.intervals],
        "confidence": [np.nan if i.confidence is None else i.confidence
                       for i in judgement.intervals],
    }  # fmt: skip
    return {name: np.array(value)[row] for name, value in values.items()}


def _hindsight_error(found: Hindsight | None, truth: Truth) -> dict[str, NDArray]:
    """Against where the scans were really taken; late stamps are the verdict's business."""
    nothing = np.full(len(truth.t_ns), np.nan)
    if found is None or not len(found.track):
        names = ("error_m", "error_rad", "nees_xy", "nees_yaw", "judged_share")
        return dict.fromkeys(names, nothing)
    at = found.track.at(truth.t_ns)
    step = at.xyyaw - truth.xyyaw_taken
    step[:, 2] = se2.wrap_angle(step[:, 2])
    white = [whitened(step[:, axes], at.cov[:, axes, axes]) for axes in (slice(2), slice(2, 3))]
    share = nothing
    if found.changes is not None and len(found.changes.t_ns):
        order = np.argsort(found.changes.t_ns, kind="stable")
        t_ns, shares = found.changes.t_ns[order], found.changes.changed_share[order]
        share = shares[np.clip(np.searchsorted(t_ns, truth.t_ns), 0, len(t_ns) - 1)]
    return {
        "error_m": np.hypot(step[:, 0], step[:, 1]),
        "error_rad": np.abs(step[:, 2]),
        "nees_xy": np.sum(white[0] ** 2, axis=1),
        "nees_yaw": np.sum(white[1] ** 2, axis=1),
        "judged_share": share,
    }


def _ratio(
    view: BundleView,
    found: Hindsight | None,
    belief: PoseTrack | None,
    t_ns: NDArray[np.int64],
) -> dict[str, NDArray]:
    """The largest limit of lost at which the verdict's own rule would call each moment lost.

    Sweeping the limit gives the verdict's ROC: like the verdict, it takes late stamps and the
    offset of a map frame off, bridges short interruptions, and lets what is too short pass.
    """
    if found is None or belief is None or not len(found.track):
        return {"ratio": np.full(len(t_ns), np.nan)}
    limits = Limits()
    error = gathered(view, belief, found, limits, scan_delay(view, found)).error
    ratio = np.fmax(error.distance_m / limits.position_m, error.heading_rad / limits.yaw_rad)
    return {"ratio": sustained(error.t_ns, ratio, t_ns, limits)}


def sustained(
    t_ns: NDArray[np.int64], values: se2.Array, at_ns: NDArray[np.int64], limits: Limits
) -> se2.Array:
    """(M,) levels that values (N,) at sorted times (N,) keep for as long as lost must last.

    A grey closing and opening over time (Serra, 1982): at every threshold what stays above it is
    what `slamreplay.verdict.timeline.settled` would keep. NaN where nothing is known.
    """
    step_ns = ns(_STEP_S)
    grid = np.arange(int(t_ns[0]), int(t_ns[-1]) + step_ns, step_ns)
    level = values[_latest(t_ns, grid)]
    bridge, least = (round(s / _STEP_S) for s in (limits.bridge_s, limits.lost_s))
    around = bridge + least  # beyond the log nothing is known
    level = np.pad(np.where(np.isnan(level), -np.inf, level), around, constant_values=-np.inf)
    level = grey_opening(grey_closing(level, bridge), least)[around:-around]
    level = level[_latest(grid, at_ns)]
    return np.where(np.isfinite(level), level, np.nan)


def _latest(t_ns: NDArray[np.int64], at_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """(M,) rows of sorted times (N,) that are the last ones at or before each time."""
    return np.clip(np.searchsorted(t_ns, at_ns, side="right") - 1, 0, None)


def _regions(
    made: Incident, truth: Truth, found: Hindsight | None, grid: OccupancyGrid | None
) -> dict[str, Any]:
    """Changes that were there to be found, those found, and the area of what was not there."""
    there = [r for r in truth.regions if r.seen_s >= _SEEN_S]
    facts: dict[str, Any] = {"regions": len(there), "regions_found": 0, "missed_regions": []}
    if found is None or found.changes is None or grid is None:
        return {**facts, "false_area_m2": 0.0, "judged_area_m2": 0.0}
    for region in there:
        boxes = [b for r in found.changes.regions for k, b in _boxes(r) if k == region.kind]
        if any(_touch(region.bbox_m, b) for b in boxes):
            facts["regions_found"] += 1
        else:
            facts["missed_regions"].append([region.kind, region.name, round(region.seen_s, 1)])
    judged = found.changes.appeared | found.changes.removed
    false = judged
    if truth.regions and judged.any():
        really = changed_cells(made.recording, grid, made.recording.scenario.standing)
        if really.any():
            away = distance_transform_edt(~really, sampling=grid.resolution_m)
            false = judged & (away > _AROUND_M)
    cell = grid.resolution_m**2
    return {
        **facts,
        "false_area_m2": float(false.sum() * cell),
        "judged_area_m2": float(judged.sum() * cell),
    }


def _boxes(region: ChangedRegion) -> list[tuple[str, tuple[float, float, float, float]]]:
    """A moved region is one that appeared and one that was removed."""
    if region.kind != "moved":
        return [(region.kind, region.bbox_m)]
    old = [] if region.from_bbox_m is None else [("removed", region.from_bbox_m)]
    return [("appeared", region.bbox_m), *old]


def _touch(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    return (
        a[0] - _TOUCH_M <= b[2]
        and b[0] <= a[2] + _TOUCH_M
        and a[1] - _TOUCH_M <= b[3]
        and b[1] <= a[3] + _TOUCH_M
    )
