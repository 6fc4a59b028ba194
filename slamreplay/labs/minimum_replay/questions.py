"""What a post-mortem is asked, and what it answers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from slamreplay.evidence.result import Postmortem
from slamreplay.simulate.recording import Recording
from slamreplay.simulate.topics import START_NS
from slamreplay.verdict.judgement import UNDECIDED

#: Numbers that differ by no more than this share of the larger are the same answer.
_SAME = 0.1


@dataclass(frozen=True)
class Answer:
    """What was said.

    Attributes:
        text: a few words; empty where there is no answer.
        numbers: those of it that are compared by size.
        words: what of it is compared letter by letter.
    """

    text: str = ""
    numbers: tuple[float, ...] = ()
    words: str = ""

    @property
    def known(self) -> bool:
        """Whether there is one."""
        return bool(self.text)

    def is_same(self, other: Answer) -> bool:
        """Whether both say the same, numbers to a tenth."""
        if (self.known, self.words) != (other.known, other.words):
            return False
        if len(self.numbers) != len(other.numbers):
            return False
        pairs = zip(self.numbers, other.numbers, strict=True)
        return all(math.isclose(a, b, rel_tol=_SAME, abs_tol=1e-9) for a, b in pairs)


NONE = Answer()


def _state(post: Postmortem, _: Recording) -> Answer:
    """The verdict; half of it where no belief was recorded."""
    state = post.judgement.state
    if state in UNDECIDED:
        return NONE
    if post.belief is None or not post.belief.has_pose.any():
        half = "map changed" if "changed" in state else "map right"
        return Answer(f"{half}; lost?", words=f"{state}?")
    return Answer(state.replace("_", " "), words=state)


def _began(post: Postmortem, _: Recording) -> Answer:
    kind = post.judgement.failure_mode.kind
    return NONE if kind == "none" else Answer(kind.replace("_", " "), words=kind)


def _where(post: Postmortem, recording: Recording) -> Answer:
    """Hindsight against the simulator's truth: how well it knows where the robot was."""
    if post.hindsight is None or not post.hindsight.track.has_pose.any():
        return NONE
    track = post.hindsight.track.take(post.hindsight.track.has_pose)
    true = recording.motion.poses_at((track.t_ns - START_NS) / 1e9)
    far = float(np.quantile(np.hypot(*(track.xyyaw - true)[:, :2].T), 0.95))
    return Answer(f"to {far:.3f} m", (far,))


def _error(post: Postmortem, _: Recording) -> Answer:
    if post.error is None or not np.isfinite(post.error.distance_m).any():
        return NONE
    rms = float(np.sqrt(np.nanmean(post.error.distance_m**2)))
    return Answer(f"rms {rms:.2f} m", (rms,))


def _nees(post: Postmortem, _: Recording) -> Answer:
    if post.nees is None:
        return NONE
    test = post.nees.summary().test
    return NONE if test.mean is None else Answer(f"mean {test.mean:.3g}", (test.mean,))


def _changed(post: Postmortem, _: Recording) -> Answer:
    if post.hindsight is None or post.hindsight.changes is None or post.grid is None:
        return NONE
    regions = post.hindsight.changes.regions
    area = float(sum(r.area_m2 for r in regions))
    return Answer(f"{area:.1f} m²", (area,))


def _gate(post: Postmortem, _: Recording) -> Answer:
    asked = [a for a in post.judgement.actions if a.allowed is not None]
    if not asked:
        return NONE
    allowed = sum(bool(a.allowed) for a in asked)
    clearance = float(np.mean([a.clearance_m for a in asked if a.clearance_m is not None] or [0.0]))
    text = f"{allowed} of {len(asked)}, {clearance:.2f} m"
    return Answer(text, (allowed, len(asked), clearance))


def _contract(post: Postmortem, _: Recording) -> Answer:
    told = [a.belief for a in post.judgement.actions if a.belief is not None]
    if not told or all(b.t_ns is None for b in told):
        return NONE
    whole = sum(not b.lacks for b in told)
    return Answer(f"{whole} of {len(told)}", (whole, len(told)))


def _stops(post: Postmortem, _: Recording) -> Answer:
    recoveries = [a for a in post.judgement.actions if a.kind == "recovery"]
    inferred = sum(a.inferred for a in recoveries)
    how = "" if not recoveries else "recorded" if not inferred else "inferred"
    n = len(post.judgement.stops)
    text = f"{n}, {len(recoveries)} {how}" if recoveries else f"{n}, none"
    return Answer(text, (n, len(recoveries)), how)


#: Question to what answers it, in the order of a report.
QUESTIONS: dict[str, Callable[[Postmortem, Recording], Answer]] = {
    "lost or changed": _state,
    "how it began": _began,
    "where it was": _where,
    "error of the belief": _error,
    "its NEES": _nees,
    "what had changed": _changed,
    "motions allowed, clearance": _gate,
    "actions with a whole contract": _contract,
    "stops and recoveries": _stops,
}
