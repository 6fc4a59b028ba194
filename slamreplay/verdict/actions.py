"""What the robot did, and whether it knew well enough where it was to do it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from slamreplay.bundle.findings import Finding
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.verdict.belief_error import BeliefError
from slamreplay.verdict.clearance import Clearance, Obstacles
from slamreplay.verdict.contract import Contract
from slamreplay.verdict.gate import allows, ratio, sigma_towards
from slamreplay.verdict.goals import recoveries
from slamreplay.verdict.judgement import UNDECIDED, Action, Interval
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.motion import motion_starts
from slamreplay.verdict.paths import Paths

#: A plan this recent is what a motion follows.
PLANNED_NS = 2_000_000_000
#: A robot this far inside of the limits is right about where it is.
RIGHT = 0.5

Kind = Literal["recovery", "motion"]


@dataclass(frozen=True, eq=False)
class Outcome:
    """What became of the log, to judge its actions by: belief against hindsight, and the tiles."""

    error: BeliefError
    intervals: Sequence[Interval]


def actions(
    view: BundleView, belief: PoseTrack | None, limits: Limits, outcome: Outcome | None = None
) -> tuple[Action, ...]:
    """Recoveries and beginnings of motion, in time order, each put through the gate.

    Args:
        view: the log.
        belief: base in map as believed.
        limits: of the gate and of the contract.
        outcome: with it each action also gets the belief's real error, recoveries whether they
            were needless.
    """
    begun = recoveries(view)
    inferred = {(r.t_ns, r.name) for r in begun if r.inferred}
    moments: list[tuple[int, Kind, str, str]] = [
        (r.t_ns, "recovery", r.name, f"behaviour {r.name}") for r in begun
    ]
    plan, command = view.manifest.topic_of("plan"), view.manifest.topic_of("command")
    table = view.role("plan")
    plans = np.zeros(0, dtype=np.int64) if table is None else np.sort(table.t_ns)
    for t in motion_starts(view, belief):
        before = int(np.searchsorted(plans, t, side="right")) - 1
        planned = before >= 0 and t - int(plans[before]) <= PLANNED_NS
        by = command or "motion"
        moments.append(
            (t, "motion", "plan", f"{by} along {plan}") if planned else (t, "motion", "command", by)
        )
    if not moments:
        return ()
    obstacles = Obstacles(view, belief, limits.footprint_radius_m)
    contract, paths = Contract(view, belief, limits), Paths(view, belief)
    found = []
    for t, kind, name, consumer in sorted(moments):
        path = paths.ahead(t, planned=name == "plan")
        sigma, room = room_at(t, belief, obstacles, path)
        clearance = None if room is None else room.metres
        judged = sigma is not None and clearance is not None
        error = None if outcome is None else _error(outcome.error, t)
        is_inferred = kind == "recovery" and (t, name) in inferred
        found.append(
            Action(
                t,
                kind,
                name,
                sigma,
                clearance,
                ratio(sigma or 0.0, clearance or 0.0, limits.gate_sigmas) if judged else None,
                allows(sigma or 0.0, clearance or 0.0, limits.gate_sigmas) if judged else None,
                error,
                None if is_inferred else _needless(t, kind, error, outcome, limits),
                contract.at(t, consumer),
                is_inferred,
            )
        )
    return tuple(found)


def risky(found: tuple[Action, ...]) -> tuple[Finding, ...]:
    """What the gate has to say of the actions, one finding for each of its questions.

    SR-ACT-001 for all that it would have blocked, SR-ACT-004 for those that only a false
    covariance let pass, SR-ACT-005 for recoveries of a robot that was right. Recoveries that were
    inferred count for none: the motions they are inferred from are judged as motions.
    """
    found = tuple(a for a in found if not a.inferred)
    blocked = [a for a in found if a.allowed is False]
    deceived = [
        a
        for a in found
        if a.allowed and a.error_m is not None and a.error_m > (a.clearance_m or np.inf)
    ]
    needless = [a for a in found if a.needless]
    out: list[Finding] = []
    if blocked:
        judged = sum(a.allowed is not None for a in found)
        worst = max(blocked, key=lambda a: np.inf if a.ratio is None else a.ratio)
        room = max(worst.clearance_m or 0.0, 0.0)
        text = (
            f"{len(blocked)} of {judged} actions should have been blocked: 3 sigma went beyond the "
            f"clearance; the worst, {worst.name}, had a sigma of {worst.sigma_m or 0.0:.2f} m and "
            f"{room:.2f} m of room"
        )
        out.append(_finding("SR-ACT-001", "warning", text, blocked, worst.ratio, 1.0, judged))
    if deceived:
        far = max(deceived, key=lambda a: a.error_m or 0.0)
        text = (
            f"{len(deceived)} actions passed the gate on a covariance that was too small; the "
            f"worst, {far.name}, believed to be {far.error_m or 0.0:.2f} m from where it was, with "
            f"{far.clearance_m or 0.0:.2f} m of room and a sigma of {far.sigma_m or 0.0:.2f} m"
        )
        value = None if far.error_m is None else far.error_m / max(far.clearance_m or 0.0, 1e-3)
        out.append(_finding("SR-ACT-004", "warning", text, deceived, value, 1.0, len(found)))
    if needless:
        names = ", ".join(dict.fromkeys(a.name for a in needless))
        text = (
            f"{len(needless)} recoveries were needless as far as the map goes: the robot was right "
            f"about where it was, and so was the map ({names})"
        )
        out.append(_finding("SR-ACT-005", "info", text, needless, None, None, len(found)))
    return tuple(out)


def _finding(
    id_: str,
    severity: Literal["info", "warning"],
    text: str,
    about: Sequence[Action],
    value: float | None,
    high: float | None,
    n: int,
) -> Finding:
    return Finding(
        id_,
        severity,
        text,
        start_ns=about[0].t_ns,
        end_ns=about[-1].t_ns,
        value=value,
        low=None if high is None else 0.0,
        high=high,
        unit="" if high is None else "ratio",
        n=n,
    )


def room_at(
    t_ns: int, belief: PoseTrack | None, obstacles: Obstacles, path_xy: se2.Array
) -> tuple[float | None, Clearance | None]:
    """Standard deviation towards the nearest obstacle along the path, and the room to it.

    Args:
        t_ns: the time, on the bundle's clock.
        belief: base in map with its covariance.
        obstacles: what stands there.
        path_xy: (M, 2) places the robot is about to pass, in its base frame at that time.
    """
    room = obstacles.clearance(t_ns, path_xy)
    covariance = None if belief is None else _covariance_at(belief, t_ns)
    if room is None or covariance is None:
        return None, room
    return sigma_towards(covariance, room.direction_xy), room


def _error(error: BeliefError, t_ns: int) -> float | None:
    """The belief's distance from hindsight at the scan before a time, at most a second old."""
    row = int(np.searchsorted(error.t_ns, t_ns, side="right")) - 1
    row = max(row, 0)
    if not len(error.t_ns) or abs(t_ns - int(error.t_ns[row])) > 1_000_000_000:
        return None
    known = error.known[row] and np.isfinite(error.distance_m[row])
    return float(error.distance_m[row]) if known else None


def _needless(
    t_ns: int, kind: Kind, error_m: float | None, outcome: Outcome | None, limits: Limits
) -> bool | None:
    if kind != "recovery" or outcome is None or error_m is None:
        return None
    state = next((i.state for i in outcome.intervals if i.start_ns <= t_ns < i.end_ns), None)
    if state is None or state in UNDECIDED:
        return None
    return state == "healthy" and error_m <= RIGHT * limits.position_m


def _covariance_at(belief: PoseTrack, t_ns: int) -> se2.Array | None:
    """The covariance that held at a time: the last one given before it."""
    given = np.isfinite(belief.cov[:, :2, :2]).all(axis=(1, 2)) & (belief.t_ns <= t_ns)
    rows = np.flatnonzero(given)
    return belief.cov[rows[np.argmax(belief.t_ns[rows])]] if len(rows) else None
