"""What the robot did, and whether it knew well enough where it was to do it."""

from __future__ import annotations

from typing import Literal

import numpy as np

from slamreplay.bundle.findings import Finding
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.verdict.clearance import Obstacles
from slamreplay.verdict.gate import allows, ratio, sigma_towards
from slamreplay.verdict.judgement import Action
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.motion import motion_starts, recoveries

#: A plan this recent is what a motion follows.
PLANNED_NS = 2_000_000_000


def actions(view: BundleView, belief: PoseTrack | None, limits: Limits) -> tuple[Action, ...]:
    """Recoveries and beginnings of motion, in time order, each put through the gate."""
    moments: list[tuple[int, Literal["recovery", "motion"], str]] = [
        (r.t_ns, "recovery", r.name) for r in recoveries(view)
    ]
    table = view.role("plan")
    plans = np.zeros(0, dtype=np.int64) if table is None else np.sort(table.t_ns)
    for t in motion_starts(view, belief):
        before = int(np.searchsorted(plans, t, side="right")) - 1
        planned = before >= 0 and t - int(plans[before]) <= PLANNED_NS
        moments.append((t, "motion", "plan" if planned else "command"))
    if not moments:
        return ()
    obstacles = Obstacles(view, belief, limits.footprint_radius_m)
    return tuple(
        _action(t, kind, name, belief, obstacles, limits) for t, kind, name in sorted(moments)
    )


def risky(found: tuple[Action, ...]) -> tuple[Finding, ...]:
    """SR-ACT-001: one finding for all actions that the gate would have blocked."""
    blocked = [a for a in found if a.allowed is False]
    if not blocked:
        return ()
    judged = sum(a.allowed is not None for a in found)
    worst = max(blocked, key=lambda a: np.inf if a.ratio is None else a.ratio)
    room = max(worst.clearance_m or 0.0, 0.0)
    text = (
        f"{len(blocked)} of {judged} actions began with 3 sigma beyond the clearance; the worst, "
        f"{worst.name}, with a sigma of {worst.sigma_m or 0.0:.2f} m and {room:.2f} m of room"
    )
    return (
        Finding(
            "SR-ACT-001",
            "warning",
            text,
            start_ns=blocked[0].t_ns,
            end_ns=blocked[-1].t_ns,
            value=worst.ratio,
            low=0.0,
            high=1.0,
            unit="ratio",
            n=judged,
        ),
    )


def _action(
    t_ns: int,
    kind: Literal["recovery", "motion"],
    name: str,
    belief: PoseTrack | None,
    obstacles: Obstacles,
    limits: Limits,
) -> Action:
    room = obstacles.clearance(t_ns)
    covariance = None if belief is None else _covariance_at(belief, t_ns)
    if room is None or covariance is None:
        return Action(t_ns, kind, name, None, None if room is None else room.metres, None, None)
    sigma = sigma_towards(covariance, room.direction_xy)
    if sigma is None:
        return Action(t_ns, kind, name, None, room.metres, None, None)
    return Action(
        t_ns,
        kind,
        name,
        sigma,
        room.metres,
        ratio(sigma, room.metres, limits.gate_sigmas),
        allows(sigma, room.metres, limits.gate_sigmas),
    )


def _covariance_at(belief: PoseTrack, t_ns: int) -> np.ndarray | None:
    """The covariance that held at a time: the last one given before it."""
    given = np.isfinite(belief.cov[:, :2, :2]).all(axis=(1, 2)) & (belief.t_ns <= t_ns)
    rows = np.flatnonzero(given)
    return belief.cov[rows[np.argmax(belief.t_ns[rows])]] if len(rows) else None
