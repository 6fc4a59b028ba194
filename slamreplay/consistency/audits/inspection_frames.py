"""The tf audit as plain data."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from slamreplay.audit.log_audit import LogAudit, key
from slamreplay.audit.tf_steps import Steps
from slamreplay.bundle.manifest import FrameEdge

#: So many steps are spelt out, the largest first.
_STEPS = 5


def frames_audit(audit: LogAudit) -> dict[str, Any]:
    """The tree with each edge's rhythm, and what the audit found of it."""
    frames = audit.view.manifest.frames
    jumps, moved = audit.odometry_jumps, audit.corrections
    return {
        "map": frames.map,
        "odom": frames.odom,
        "base": frames.base,
        "tree": [_edge(audit, edge) for edge in frames.tree],
        "without_tf": _without_tf(audit),
        "left_out": [edge.model_dump() for edge in frames.left_out],
        "faults": [asdict(fault) for fault in audit.tree_faults],
        "disagreements": [{**asdict(d), "edge": list(d.edge)} for d in audit.disagreements],
        "loose": [{**asdict(f), "topics": list(f.topics)} for f in audit.loose_frames],
        "cover": {topic: asdict(told) for topic, told in audit.covers.items()},
        "odometry_jumps": None if jumps is None else _steps(jumps),
        "corrections": None
        if moved is None
        else {**_steps(moved.at_robot), "most_at_origin_m": _most(moved.at_origin)},
    }


def _edge(audit: LogAudit, edge: FrameEdge) -> dict[str, Any]:
    own = [s for s in audit.edges if s.edge == (edge.parent, edge.child)]
    told: dict[str, Any] = {"topics": sorted({s.topic for s in own}), "rate_hz": None,
                            "log_minus_stamp_median_s": None, "ahead_s": None, "ahead_of": None,
                            "gaps": 0, "longest_gap_s": None}  # fmt: skip
    if own:
        stream = max(own, key=len)
        late, rhythm = audit.delays[key(stream)], audit.rates[key(stream)]
        lead = audit.leads.get(key(stream))
        if not edge.is_static and rhythm.period_s:
            told["rate_hz"] = round(1.0 / rhythm.period_s, 3)
            told["gaps"] = len(rhythm.gaps)
            told["longest_gap_s"] = rhythm.gaps[0].seconds if rhythm.gaps else None
        if late is not None:
            told["log_minus_stamp_median_s"] = round(late.median_s, 6)
        if lead is not None:
            told["ahead_s"], told["ahead_of"] = round(lead.seconds, 6), lead.over
    return {**edge.model_dump(), **told}


def _without_tf(audit: LogAudit) -> list[str]:
    """Sensor frames that do not hang in the base's tree: they are taken to be the base itself."""
    base, buffer = audit.view.manifest.frames.base, audit.view.transforms
    frames = audit.sensor_frames
    if base is None:
        return frames
    return [f for f in frames if f != base and not buffer.has_path(base, f)]


def _steps(steps: Steps) -> dict[str, Any]:
    worst = np.argsort(-steps.metres, kind="stable")[:_STEPS]
    told = zip(steps.t_ns[worst].tolist(), steps.metres[worst].tolist(),
               steps.radians[worst].tolist(), strict=True)  # fmt: skip
    return {
        "count": len(steps),
        "median_m": float(np.median(steps.metres)) if len(steps) else None,
        "most_m": _most(steps.metres),
        "most_rad": _most(steps.radians),
        "worst": [{"t_ns": t_ns, "m": m, "rad": rad} for t_ns, m, rad in told],
    }


def _most(values: np.ndarray) -> float | None:
    return float(values.max()) if len(values) else None
