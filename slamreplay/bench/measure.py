"""One case: made, looked back on, judged, and written down moment by moment beside its truth."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from slamreplay.bench.baselines import FIELD_THRESHOLDS, baseline_scores
from slamreplay.bench.incidents import Incident, incident
from slamreplay.bench.logs import bundle_of
from slamreplay.bench.schedule import Case
from slamreplay.bench.truth import Truth, changed_cells
from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.products import ChangedRegion, Hindsight
from slamreplay.bundle.scans import scan_set
from slamreplay.geometry import se2
from slamreplay.hindsight.pipeline import hindsight
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.postmortem import belief_times
from slamreplay.verdict.belief_error import belief_error
from slamreplay.verdict.judge import judge
from slamreplay.verdict.judgement import Judgement
from slamreplay.verdict.limits import Limits

#: A change counts as there to be found from here on; around it nothing is called false, m.
_SEEN_S, _AROUND_M, _TOUCH_M = 4.0, 0.3, 0.15


@dataclass(frozen=True, eq=False)
class Measured:
    """One judged log: `moments` are arrays (N,), `facts` what is said once; see `measured`."""

    case: Case
    facts: dict[str, Any]
    moments: dict[str, NDArray] = field(default_factory=dict)


def measured(case: Case) -> Measured:
    """Play a case through all stages.

    Moments: t_s; lost, changed by truth; judged_lost, judged_changed; unjudged; confidence of the
    interval; error_m, error_rad of hindsight; ratio (how far the belief is from hindsight, in
    limits of lost); changed_share by truth and by hindsight; the baselines' scores.
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
        **_ratio(found, belief, truth.t_ns),
    }
    laser = scan_set(view)
    for name, scores in baseline_scores(view).items():
        at = np.full(len(truth.t_ns), np.nan)
        if laser is not None and len(laser):
            row = np.clip(np.searchsorted(laser.t_ns, truth.t_ns), 0, len(laser) - 1)
            at = np.where(laser.t_ns[row] == truth.t_ns, scores[row], np.nan)
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
        return {"error_m": nothing, "error_rad": nothing, "judged_share": nothing}
    step = found.track.at(truth.t_ns).xyyaw - truth.xyyaw_taken
    share = nothing
    if found.changes is not None and len(found.changes.t_ns):
        order = np.argsort(found.changes.t_ns, kind="stable")
        t_ns, shares = found.changes.t_ns[order], found.changes.changed_share[order]
        share = shares[np.clip(np.searchsorted(t_ns, truth.t_ns), 0, len(t_ns) - 1)]
    return {
        "error_m": np.hypot(step[:, 0], step[:, 1]),
        "error_rad": np.abs(se2.wrap_angle(step[:, 2])),
        "judged_share": share,
    }


def _ratio(found: Hindsight | None, belief: Any, t_ns: NDArray[np.int64]) -> dict[str, NDArray]:
    if found is None or belief is None or not len(found.track):
        return {"ratio": np.full(len(t_ns), np.nan)}
    limits = Limits()
    error = belief_error(belief, found, limits)
    ratio = np.fmax(error.distance_m / limits.position_m, error.heading_rad / limits.yaw_rad)
    row = np.clip(np.searchsorted(error.t_ns, t_ns), 0, len(error.t_ns) - 1)
    return {"ratio": np.where(error.t_ns[row] == t_ns, ratio[row], np.nan)}


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
