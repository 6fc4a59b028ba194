"""What can be put back of start and motion: a wrong pose, a slip, a carry, worn wheels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from slamreplay.geometry import se2
from slamreplay.rootcause.doses import Slip
from slamreplay.rootcause.healing import START_COV, Healed
from slamreplay.rootcause.incident import Incident
from slamreplay.rootcause.trial import Trial
from slamreplay.rootcause.words import apart
from slamreplay.verdict.judgement import FailureKind

#: A start within this of the truth, m and rad, is as right as a careful person clicks it; one that
#: its own covariance does not reach (Mahalanobis distance squared of three numbers, 99.9 %) is not.
_CLICKED_M, _CLICKED_RAD, _REACH = 0.35, np.radians(12.0), 16.3


def starts(incident: Incident, healed: Healed) -> Iterator[Trial]:
    """The first pose as it was told, with the covariance it was told with."""
    rows = np.flatnonzero(np.isfinite(incident.belief).all(axis=1))
    if not incident.from_start or not len(rows):
        return
    first = int(rows[0])
    said, cov = incident.belief[first], _sound(incident.cov[first])
    off = said - healed.truth[first]
    off[2] = se2.wrap_angle(off[2])
    metres, turn = float(np.hypot(off[0], off[1])), float(abs(off[2]))
    evidence = replace(healed.evidence, start=said, cov=cov)
    if metres <= _CLICKED_M and turn <= _CLICKED_RAD:
        wide = float(np.sqrt(np.linalg.eigvalsh(cov[:2, :2])[-1]))
        words = f"the first pose, told to within {wide:.1f} m,"
        yield Trial("", "sensing_ambiguity", wide, "m", 0, words, evidence)
        return
    words = f"the first pose, {apart(metres, turn)} off,"
    yield Trial("initial_pose.offset", "wrong_initial_pose", metres, "m", 0, words, evidence)


def motions(incident: Incident, healed: Healed) -> Iterator[Trial]:
    """Odometry as it was recorded, where it slipped, where it was carried, and all along."""
    if not np.isfinite(incident.odometry).all():
        return
    kinds: tuple[tuple[bool, FailureKind, str], ...] = (
        (False, "odometry_slip", "odometry_slip.window"),
        (True, "kidnapped", "odometry_slip.carried"),
    )
    for carried, kind, name in kinds:
        slips = [s for s in healed.slips if s.is_carried == carried]
        if slips:
            yield _slipped(incident, healed, slips, kind, name)
    wheels = incident.case.wheels
    if wheels is not None and wheels.calibration_words:
        told = replace(healed.evidence, odometry=healed.odometry_of(healed.steps_but_slips))
        level = 1.0 if wheels.scale is None else wheels.scale
        name, words = "odometry_scale.translation", f"{wheels.calibration_words[0]}, which"
        yield Trial(name, "odometry_slip", level, "ratio", None, words, told)


def _slipped(
    incident: Incident, healed: Healed, slips: list[Slip], kind: FailureKind, name: str
) -> Trial:
    steps = healed.steps.copy()
    for s in slips:
        steps[s.first : s.last] = healed.told_steps[s.first : s.last]
    worst = max(slips, key=lambda s: s.metres + abs(s.radians))
    since = incident.case.seconds(int(incident.t_ns[worst.first]))
    far = apart(worst.metres, abs(worst.radians))
    words = f"odometry as recorded from {since} on, {far} otherwise than the robot moved,"
    told = replace(healed.evidence, odometry=healed.odometry_of(steps))
    return Trial(name, kind, worst.metres, "m", worst.first, words, told)


def _sound(cov: se2.Array) -> se2.Array:
    if np.isfinite(cov).all() and np.linalg.eigvalsh(cov)[0] >= 0.0 and cov[0, 0] > 0.0:
        return cov
    return START_COV
