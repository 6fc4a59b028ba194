"""Jumps of a belief with their causes: the ledger's of a run, the log's of what was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.run import Innovations
from slamreplay.consistency.belief.jumps.log_events import Event, log_events
from slamreplay.consistency.belief.jumps.steps import Step, sizes_of, steps_of
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence.clouds import clouds_in, sound_particles
from slamreplay.estimators import RECORDED
from slamreplay.estimators.recorded import recorded_ledger
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S

#: A jump the ledger moved the belief by less than this share of is not explained by it.
_EXPLAINED = 0.5
#: Particles this near are of the place the belief jumped to.
_THERE_M, _THERE_RAD = 0.5, np.radians(20.0)
#: Silence of the localizer that is worth a word.
_SILENT_NS = 3 * NS_PER_S


@dataclass(frozen=True)
class Jump:
    """A step of a belief and what made it.

    Attributes:
        step: when and how far.
        cause: in words.
        is_given: whether somebody set the pose on purpose.
        error_before_m: how far the belief was off before it by the best reference, m.
        error_after_m: the same after it; None where no reference tells.
    """

    step: Step
    cause: str
    is_given: bool = False
    error_before_m: float | None = None
    error_after_m: float | None = None

    @property
    def led_astray(self) -> bool | None:
        """Whether the belief was farther off after it; None where nothing tells."""
        if self.error_before_m is None or self.error_after_m is None:
            return None
        return self.error_after_m > self.error_before_m


def jumps_of(context: CheckContext) -> tuple[Jump, ...]:
    """The jumps of a belief in order of time; none without a belief or without odometry."""
    if context.belief is None:
        return ()
    ledger: tuple[Innovations, ...] = context.innovations
    if not context.subject:
        ledger = (recorded_ledger(context.view),)
    steps = steps_of(context.belief, odometry_track(context.view), ledger)
    events = log_events(context.view) if steps else ()
    return tuple(_jump(context, step, ledger, events) for step in steps)


def row_words(one: Innovations, row: int) -> str:
    """What a row of the ledger was: source, subject, score and NIS where they are known."""
    about, score, nis = (
        str(one.about[row]),
        float(one.score[row]),
        float(one.nis_of(np.array([row]))[0]),
    )
    words = [about if about.startswith(one.source) else f"{one.source} {about}".strip()]
    words += [f"score {score:.2f}"] if np.isfinite(score) else []
    words += [f"NIS {nis:.3g}"] if np.isfinite(nis) else []
    return ", ".join(words)


def _jump(
    context: CheckContext, step: Step, ledger: Sequence[Innovations], events: Sequence[Event]
) -> Jump:
    near = [e for e in events if e.may_have_made(step.before_ns, step.t_ns)]
    near = sorted(near, key=lambda e: (not e.is_given, abs(e.t_ns - step.t_ns)))
    is_recorded = context.subject in ("", *RECORDED)
    made = "" if is_recorded else _made_by(step, ledger)
    if is_recorded:
        causes = [e.near(step.t_ns) for e in near[:3]] + _of_localizer(context, step, ledger)
        cause = "; ".join(causes) or "an update of its own: nothing else in the log is near it"
    elif made:
        cause = made
    else:  # of runs only what they read of the log can move them beside their measurements
        cause = "; ".join(e.near(step.t_ns) for e in near[:3]) or _unexplained(ledger)
    before, after = _errors(context, step)
    return Jump(step, cause, bool(near) and near[0].is_given and not made, before, after)


def _unexplained(ledger: Sequence[Innovations]) -> str:
    return "nothing in its ledger explains it" if ledger else "it keeps no ledger"


def _made_by(step: Step, ledger: Sequence[Innovations]) -> str:
    """The row that made a run's step, in words; empty where the ledger does not explain it."""
    if step.row is None:
        return ""
    one, row = ledger[step.row[0]], step.row[1]
    size = float(sizes_of(one.moved[[row]])[0])
    if not np.isfinite(size):
        return f"{row_words(one, row)} (how far it moved the belief was not told)"
    if size < _EXPLAINED * step.size:
        return ""
    moved = one.moved[row]
    size_words = f"{np.hypot(*moved[:2]):.2f} m, {np.degrees(abs(moved[2])):.0f} deg"
    return f"{row_words(one, row)}, moved it by {size_words}"


def _of_localizer(context: CheckContext, step: Step, ledger: Sequence[Innovations]) -> list[str]:
    """What its particles and its silence tell of a jump of the recorded localizer."""
    told = []
    words = ledger[0].t_ns if ledger else np.empty(0, dtype=np.int64)
    k = int(np.searchsorted(words, step.before_ns, side="right"))
    if 0 < k < len(words) and words[k] - words[k - 1] > _SILENT_NS:
        told.append(f"its first word for {(words[k] - words[k - 1]) / NS_PER_S:.1f} s")
    assert context.belief is not None  # or nothing would have jumped
    clouds = clouds_in(context.view, context.belief.frame_id)
    if clouds is None:
        return told
    last = int(np.searchsorted(clouds.t_ns, step.before_ns, side="right")) - 1
    if last < 0 or step.before_ns - clouds.t_ns[last] > 2 * NS_PER_S:
        return told
    particles, share = sound_particles(clouds["xyyaw"][last], clouds["weights"][last])
    off = particles - step.xyyaw
    there = np.hypot(off[:, 0], off[:, 1]) < _THERE_M
    there &= np.abs(se2.wrap_angle(off[:, 2])) < _THERE_RAD
    standing = float(share[there].sum())
    if standing > 0.0:
        told.append(f"{100.0 * standing:.2g} % of its particles stood there already")
    else:
        told.append("none of its particles stood there: they were spread or set anew")
    return told


def _errors(context: CheckContext, step: Step) -> tuple[float | None, float | None]:
    """How far the belief was off before and after, by the first reference that tells."""
    if step.before_ns == step.t_ns:
        return None, None  # of a path that was smoothed since only the movement is known
    for reference in context.references:
        where = reference.track.at(np.array([step.t_ns])).xyyaw[0, :2]
        if np.isfinite(where).all():
            before, after = (
                float(np.hypot(*(pose[:2] - where))) for pose in (step.before_xyyaw, step.xyyaw)
            )
            return before, after
    return None, None
