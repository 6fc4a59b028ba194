"""The tiles of the verdict: flags per scan, settled, numbered and given their findings."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.products import Changes, Hindsight
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.times import ns
from slamreplay.verdict.belief_error import BeliefError, belief_error
from slamreplay.verdict.confidence import confidence, p_changed, p_off, trust
from slamreplay.verdict.intervals import tiled
from slamreplay.verdict.judgement import UNDECIDED, ConstantOffset, Interval
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.map_frame import constant_offset
from slamreplay.verdict.timeline import BAD, GOOD, UNKNOWN, held, settled
from slamreplay.verdict.timing import Delay


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the tiles are made of: belief against hindsight, and the offset taken out of it.

    `lead` is hindsight's at the moments of `error`, inf where it has none.
    """

    error: BeliefError
    changes: Changes | None
    offset: ConstantOffset | None
    trusted: float
    lead: se2.Array


def gathered(
    view: BundleView,
    belief: PoseTrack | None,
    hindsight: Hindsight,
    limits: Limits,
    delay: Delay | None = None,
) -> Evidence:
    """Belief against hindsight; where the map alone is off, in the map the robot had.

    Scans that are stamped late show where the robot was before their stamps: the belief is asked
    for that time, or a right one would be called wrong by what the robot drove meanwhile.
    """
    late = delay is not None and delay.is_significant and delay.seconds > 0.0
    late_ns = ns(delay.seconds) if delay is not None and late and delay.late != "odometry" else 0
    error = belief_error(belief, hindsight, limits, late_ns)
    offset = constant_offset(view, error, limits)
    if offset is not None and offset.cause == "map" and belief is not None:
        # The robot was right in a map that lies elsewhere: judge it in that map.
        back = se2.inverse(np.array(offset.xyyaw))
        moved = PoseTrack(
            belief.frame_id,
            belief.child_frame_id,
            belief.t_ns,
            se2.compose(back, belief.xyyaw),
            belief.cov,
        )
        error = belief_error(moved, hindsight, limits, late_ns)
    order = np.argsort(hindsight.track.t_ns, kind="stable")
    lead = hindsight.lead[order] if len(hindsight.lead) else np.full(len(order), np.inf)
    return Evidence(error, hindsight.changes, offset, trust(hindsight), lead)


def intervals_of(view: BundleView, evidence: Evidence, limits: Limits) -> tuple[Interval, ...]:
    """The intervals that tile the log, with their numbers and the ids of their findings."""
    span = view.span
    if span[1] <= span[0]:
        return (Interval("insufficient_data", *span, findings=("SR-LOC-004",)),)
    error, changes, bridge = evidence.error, evidence.changes, ns(limits.bridge_s)
    lost = held(error.t_ns, _lost_flags(error, limits), *span, bridge)
    changed_t, flags = _changed_flags(error, changes, limits)
    changed = held(changed_t, flags, *span, bridge)
    tiles = tiled(
        settled(lost, ns(limits.lost_s), bridge), settled(changed, ns(limits.changed_s), bridge)
    )
    return tuple(
        _numbered(_why_unjudged(tile, evidence, limits), evidence, limits) for tile in tiles
    )


def _why_unjudged(tile: Interval, evidence: Evidence, limits: Limits) -> Interval:
    """The same tile; unobservable where another place explains most of its scans as well."""
    if tile.state != "insufficient_data":
        return tile
    t_ns = evidence.error.t_ns
    alike = evidence.lead[(t_ns >= tile.start_ns) & (t_ns < tile.end_ns)] < limits.lead
    is_most = 2 * np.count_nonzero(alike) > len(alike)
    return replace(tile, state="unobservable") if is_most else tile


def _lost_flags(error: BeliefError, limits: Limits) -> NDArray[np.int8]:
    """Before the first belief lost is not judged: nothing is held against the robot then."""
    known = error.known & np.isfinite(error.distance_m)
    flags = np.where(error.off(limits), BAD, GOOD)
    flags = np.where(known, flags, UNKNOWN)
    flags = np.where(error.spoken | ~error.known, flags, GOOD)
    first = int(np.argmax(error.spoken)) if error.spoken.any() else 0
    if first and error.t_ns[first] - error.t_ns[0] < ns(limits.bridge_s):
        flags[:first] = flags[first]  # the log began a moment before the localizer spoke
    return flags.astype(np.int8)


def _changed_flags(
    error: BeliefError, changes: Changes | None, limits: Limits
) -> tuple[NDArray[np.int64], NDArray[np.int8]]:
    if changes is None or not len(changes.t_ns):
        return error.t_ns, np.where(error.known, GOOD, UNKNOWN).astype(np.int8)
    order = np.argsort(changes.t_ns, kind="stable")
    t, share = changes.t_ns[order], changes.changed_share[order]
    with np.errstate(invalid="ignore"):
        flags = np.where(share > limits.changed_share, BAD, GOOD)
    at = np.clip(np.searchsorted(error.t_ns, t), 0, len(error.t_ns) - 1)
    known = np.isfinite(share) & ((error.t_ns[at] != t) | error.known[at])
    return t, np.where(known, flags, UNKNOWN).astype(np.int8)


def _numbered(tile: Interval, evidence: Evidence, limits: Limits) -> Interval:
    error, changes = evidence.error, evidence.changes
    inside = (error.t_ns >= tile.start_ns) & (error.t_ns < tile.end_ns) & error.known
    metres, radians = error.distance_m[inside], error.heading_rad[inside]
    metres, radians = metres[np.isfinite(metres)], radians[np.isfinite(radians)]
    ids = {
        "lost": ("SR-LOC-001",),
        "map_changed": ("SR-MAP-001",),
        "lost_and_map_changed": ("SR-LOC-001", "SR-MAP-001"),
        "insufficient_data": ("SR-LOC-004",),
        "unobservable": ("SR-LOC-002",),
    }.get(tile.state, ())
    offset = evidence.offset
    if offset is not None and (tile.is_lost or offset.cause == "map"):
        ids = (*ids, *(("SR-MAP-FRAME",) if offset.cause != "lookalike" else ()))
    sure = None
    if tile.state not in UNDECIDED:
        p = p_off(error, limits)[inside]
        # Before the first belief either may be true: then the map alone is judged.
        unspoken = 1.0 - float(np.isfinite(p).mean()) if len(p) else 0.0
        p_state = p if tile.is_lost else 1.0 - p
        p_state = p_state[np.isfinite(p_state)] if unspoken < 1.0 else np.ones(len(p))
        if changes is not None and len(changes.t_ns):
            rows = (changes.t_ns >= tile.start_ns) & (changes.t_ns < tile.end_ns)
            q = p_changed(changes.changed_share[rows], limits)
            q = q[np.isfinite(q)]
            share = float(q.mean()) if len(q) else 0.5
            p_state = p_state * (share if tile.is_changed else 1.0 - share)
        sure = confidence(p_state, evidence.trusted, unspoken)
    return replace(
        tile,
        confidence=sure,
        max_error_m=float(metres.max()) if len(metres) else None,
        max_error_rad=float(radians.max()) if len(radians) else None,
        findings=ids,
    )
