"""How it began: the first thing that went wrong before the robot was lost.

Three motions are laid beside each other over the half minute before the belief left the truth: the
odometry's, hindsight's and the belief's own. Who disagrees with whom names the culprit. This is a
first, simple reading: it names what it can show and says `none` where it can show nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.verdict.belief_error import BeliefError
from slamreplay.verdict.judgement import FailureKind, FailureMode, Interval
from slamreplay.verdict.limits import Limits

#: How far back the cause is looked for, and over which stretches motions are compared.
BACK_NS, STRETCH_NS = 30 * NS_PER_S, 3 * NS_PER_S
#: Two motions over such a stretch that differ by more than this disagree.
DISAGREE_M, DISAGREE_RAD = 0.3, np.radians(10.0)
#: A robot that really moved by this much while its wheels turned less than a quarter of it was
#: carried; so was one that jumped as far between two scans.
CARRIED_M, CARRIED_SHARE = 0.5, 0.25
#: Lost this soon after the first belief is lost from the start; a pose that somebody set this
#: shortly before is what made it so.
START_NS, RESET_NS = 3 * NS_PER_S, 5 * NS_PER_S
#: An error of this many of the belief's own standard deviations is one it did not expect.
BOLD = 3.0


def failure_mode(
    view: BundleView,
    error: BeliefError,
    hindsight: Hindsight,
    intervals: Sequence[Interval],
    sigma_belief_m: se2.Array,
    limits: Limits,
) -> FailureMode:
    """The mode of a log, from its intervals and the motions around the first loss.

    Args:
        view: the log.
        error: belief against hindsight.
        hindsight: for the changed regions.
        intervals: the verdict's.
        sigma_belief_m: (N,) the belief's own standard deviation along its error, at the rows of
            `error`; NaN where it published none.
        limits: what counts as off.
    """
    lost = [i for i in intervals if i.is_lost]
    changed = [i for i in intervals if i.is_changed]
    start = view.manifest.start_ns
    if not lost:
        total = sum(i.duration_ns for i in changed) / NS_PER_S
        if total >= limits.total_s:
            return FailureMode(
                "stale_map_use", 0.9, tuple(_changed_words(changed, hindsight, start))
            )
        return FailureMode("none", None, ())
    onset = _onset(error, lost[0], limits)
    at = f"{(onset - start) / NS_PER_S:.1f} s"
    bold = _bold_words(error, lost[0], sigma_belief_m, start)
    kind, sure, words = _cause(view, error, onset, at)
    if kind is None and any(i.start_ns <= onset + START_NS for i in changed):
        kind, sure = "stale_map_use", 0.6
        words = [f"the belief left the truth at {at}, where the map was no longer true"]
        words += _changed_words(changed, hindsight, start)
    if kind is None and bold:
        kind, sure = "overconfidence", 0.6
        words = [f"the belief left the truth at {at}; odometry and hindsight agree on the motion"]
    if kind is None:
        kind, sure = "none", None
        words = [f"the belief left the truth at {at}; none of the causes looked for can be shown"]
    return FailureMode(kind, sure, (*words, *bold))


def _cause(
    view: BundleView, error: BeliefError, onset: int, at: str
) -> tuple[FailureKind | None, float | None, list[str]]:
    first = _first_spoken(error)
    resets = view.table("initial_poses").t_ns
    reset = resets[(resets >= onset - RESET_NS) & (resets <= onset + NS_PER_S)]
    if first is not None and onset - first <= START_NS:
        row = _row(error, onset)
        far = f"{error.distance_m[row]:.2f} m and {np.degrees(error.heading_rad[row]):.0f} deg"
        words = [f"the first belief was already {far} from where the robot was"]
        if len(reset):
            words.append("a pose was set at that time")
        return "wrong_initial_pose", 0.9, words
    odometry = odometry_track(view)
    odom = None if odometry is None else odometry.at(error.t_ns).xyyaw
    if odom is not None:
        wheels = _disagreement(error.t_ns, error.where, odom, error.known, onset)
        if wheels is not None:
            return _moved_otherwise(error, wheels, view.manifest.start_ns)
    if len(reset):
        when = (int(reset[0]) - view.manifest.start_ns) / NS_PER_S
        words = [f"a pose was set at {when:.1f} s and the belief left the truth at {at}"]
        return "wrong_initial_pose", 0.7, words
    if odom is not None:
        pulled = _disagreement(error.t_ns, error.belief, odom, error.known, onset)
        if pulled is not None and pulled.metres >= DISAGREE_M:
            t = (pulled.start_ns - view.manifest.start_ns) / NS_PER_S
            text = (
                f"at {t:.1f} s the belief moved by {pulled.metres:.2f} m otherwise than odometry "
                "and hindsight: its scans were matched to the wrong place"
            )
            return "association_error", 0.6, [text]
    return None, None, []


@dataclass(frozen=True)
class _Disagreement:
    """The stretch over which two motions differ most, and when they first began to.

    Attributes:
        start: row at which the worst stretch begins.
        end: row at which it ends.
        start_ns: when the first bad stretch had gathered a quarter of its difference.
        metres: by how much the two differ over the worst stretch.
        radians: the same in heading.
        moved_m: how far the first of the two moved in it.
        other_m: how far the other one did.
        jump_m: the largest single step of the first that the other one did not make.
    """

    start: int
    end: int
    start_ns: int
    metres: float
    radians: float
    moved_m: float
    other_m: float
    jump_m: float


def _disagreement(
    t_ns: NDArray[np.int64],
    one: se2.Array,
    other: se2.Array,
    known: NDArray[np.bool_],
    onset: int,
) -> _Disagreement | None:
    """Where two tracks (N, 3) in different frames differ in their motion, before the onset."""
    sound = known & np.isfinite(one).all(axis=1) & np.isfinite(other).all(axis=1)
    sound &= (t_ns >= onset - BACK_NS) & (t_ns <= onset + NS_PER_S)
    rows = np.flatnonzero(sound)
    if len(rows) < 2:
        return None
    t = t_ns[rows]
    # The end of a stretch lies three seconds on, or at the next row where none is known that soon.
    ahead = np.searchsorted(t, t + STRETCH_NS)
    ahead = np.clip(ahead, np.arange(len(t)) + 1, len(t) - 1)
    a, b = one[rows], other[rows]
    step_a, step_b = se2.between(a, a[ahead]), se2.between(b, b[ahead])
    metres = np.hypot(*(step_a - step_b)[:, :2].T)
    radians = np.abs(se2.wrap_angle(step_a[:, 2] - step_b[:, 2]))
    bad = (metres > DISAGREE_M) | (radians > DISAGREE_RAD)
    if not bad.any():
        return None
    first = int(np.argmax(bad))
    drift = [se2.between(track[first], track[first : int(ahead[first]) + 1]) for track in (a, b)]
    grown = np.hypot(*(drift[0] - drift[1])[:, :2].T) / DISAGREE_M
    grown = np.maximum(grown, np.abs(se2.wrap_angle((drift[0] - drift[1])[:, 2])) / DISAGREE_RAD)
    begun = int(t[first + int(np.argmax(grown > 0.25 * grown[-1]))])
    worst = int(np.argmax(np.maximum(metres / DISAGREE_M, radians / DISAGREE_RAD)))
    low, high = worst, int(ahead[worst])
    hops = np.hypot(*np.diff(a[low : high + 1, :2], axis=0).T)
    hops_b = np.hypot(*np.diff(b[low : high + 1, :2], axis=0).T)
    return _Disagreement(
        int(rows[low]),
        int(rows[high]),
        begun,
        float(metres[worst]),
        float(radians[worst]),
        float(np.hypot(*step_a[worst, :2])),
        float(np.hypot(*step_b[worst, :2])),
        float((hops - hops_b).max(initial=0.0)),
    )


def _moved_otherwise(
    error: BeliefError, found: _Disagreement, start: int
) -> tuple[FailureKind, float, list[str]]:
    t = (found.start_ns - start) / NS_PER_S
    apart = f"{found.metres:.2f} m and {np.degrees(found.radians):.0f} deg"
    text = (
        f"from {t:.1f} s on odometry and hindsight differ by {apart} within "
        f"{(error.t_ns[found.end] - error.t_ns[found.start]) / NS_PER_S:.1f} s: the robot moved "
        f"{found.moved_m:.2f} m, its wheels say {found.other_m:.2f} m"
    )
    carried = found.moved_m >= CARRIED_M and found.other_m < CARRIED_SHARE * found.moved_m
    if carried or found.jump_m >= CARRIED_M:
        return "kidnapped", 0.8, [text]
    return "odometry_slip", 0.8, [text]


def _onset(error: BeliefError, lost: Interval, limits: Limits) -> int:
    """When the belief left the truth: the first scan beyond the limits in the interval."""
    inside = (error.t_ns >= lost.start_ns) & (error.t_ns < lost.end_ns) & error.off(limits)
    return int(error.t_ns[inside][0]) if inside.any() else lost.start_ns


def _first_spoken(error: BeliefError) -> int | None:
    rows = np.flatnonzero(error.spoken & error.known & np.isfinite(error.distance_m))
    return int(error.t_ns[rows[0]]) if len(rows) else None


def _row(error: BeliefError, t_ns: int) -> int:
    return int(np.clip(np.searchsorted(error.t_ns, t_ns), 0, len(error.t_ns) - 1))


def _bold_words(
    error: BeliefError, lost: Interval, sigma_m: se2.Array, start: int
) -> tuple[str, ...]:
    inside = (error.t_ns >= lost.start_ns) & (error.t_ns < lost.end_ns) & error.known
    with np.errstate(invalid="ignore", divide="ignore"):
        times = np.where(inside & (sigma_m > 0.0), error.distance_m / sigma_m, np.nan)
    if not np.isfinite(times).any():
        return ()
    row = int(np.nanargmax(times))
    if np.nanmedian(times) < BOLD:
        return ()
    t = (error.t_ns[row] - start) / NS_PER_S
    own, real = f"{sigma_m[row]:.2f} m", f"{error.distance_m[row]:.2f} m"
    return (f"it did not know: at {t:.1f} s its own sigma was {own} and its error {real}",)


def _changed_words(changed: Sequence[Interval], hindsight: Hindsight, start: int) -> list[str]:
    if not changed:
        return []
    words = [
        f"what the robot saw contradicted the map from {(i.start_ns - start) / NS_PER_S:.1f} s "
        f"to {(i.end_ns - start) / NS_PER_S:.1f} s"
        for i in changed[:3]
    ]
    regions = () if hindsight.changes is None else hindsight.changes.regions
    for region in sorted(regions, key=lambda r: -r.area_m2)[:3]:
        x, y = (region.bbox_m[0] + region.bbox_m[2]) / 2, (region.bbox_m[1] + region.bbox_m[3]) / 2
        words.append(f"{region.area_m2:.1f} m2 {region.kind} around ({x:.1f}, {y:.1f})")
    return words
