"""What can be put back of start and motion: a wrong pose, a slip, a carry, worn wheels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from slamreplay.estimators.start import given
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.rootcause.doses import Slip
from slamreplay.rootcause.first_pose import START_COV, WIDE_M, first_told, wider
from slamreplay.rootcause.healing import Healed
from slamreplay.rootcause.incident import Incident
from slamreplay.rootcause.likelihood import student
from slamreplay.rootcause.trial import Trial
from slamreplay.rootcause.words import apart

#: How far off a start is that somebody told wrongly, m; replays of a start that chance decides on.
_MISTAKE_M, SEEDS = 3.0, 6
#: A dose alone never says more than this, in nats: it may be there and do no harm.
_MOST = 8.0
#: A pose that is set so long after the belief left the truth still has to do with it.
_SOON_NS = NS_PER_S


def starts(incident: Incident, healed: Healed) -> Iterator[Trial]:
    """The first pose as it was told, with the covariance it was told with: wrong, or vague."""
    told = first_told(incident, healed.truth)
    if told is None or not incident.from_start:
        return
    pose, cov, off = told
    metres, turn = float(np.hypot(off[0], off[1])), float(abs(off[2]))
    evidence = replace(healed.evidence, start=pose, cov=cov)
    plain, more = _honest(off, START_COV), wider(cov)
    wide = float(np.sqrt(np.linalg.eigvalsh(more[:2, :2])[-1]))
    wrong, vague = _mistaken(metres, turn) - plain, _honest(off, START_COV + more) - plain
    above = max(wrong, vague if wide > WIDE_M else wrong) - _MOST
    wrong, vague = (odds - max(above, 0.0) for odds in (wrong, vague))
    if wide > WIDE_M:
        words = f"the first pose, told to within {wide:.1f} m and {apart(metres, turn)} off"
        yield Trial("initial_pose.ambiguous", "sensing_ambiguity", wide, "m", 0, words, evidence,
                    log_dose=max(vague, -_MOST), seeds=SEEDS)  # fmt: skip
    words = f"the first pose as it was told, {apart(metres, turn)} off"
    yield Trial("initial_pose.offset", "wrong_initial_pose", metres, "m", 0, words, evidence,
                log_dose=max(wrong, -_MOST), seeds=SEEDS)  # fmt: skip


def set_poses(incident: Incident, healed: Healed) -> Iterator[Trial]:
    """Poses that somebody set on the way, the one most off."""
    odometry = healed.evidence.odometry
    set_again = [s for s in given(incident.view, incident.t_ns, odometry) if s.row > 0]
    set_again = [s for s in set_again if incident.t_ns[s.row] <= incident.onset_ns + _SOON_NS]
    found = []
    for one in set_again:
        if one.xyyaw is not None:
            off = one.xyyaw - healed.truth[one.row]
            off[2] = se2.wrap_angle(off[2])
            sizes = float(np.hypot(off[0], off[1])), float(abs(off[2]))
            found.append((*sizes, off, (one.row, one.xyyaw, one.cov)))
    if not found:
        return
    metres, turn, off, pose = max(found, key=lambda f: f[0] + f[1])
    odds = min(_mistaken(metres, turn) - _honest(off, START_COV), _MOST)
    told = replace(healed.evidence, set_again=(pose,))
    row = pose[0]
    since = incident.case.seconds(int(incident.t_ns[row]))
    words = f"the pose that was set at {since}, {apart(metres, turn)} off"
    yield Trial("initial_pose.offset", "wrong_initial_pose", metres, "m", row, words, told,
                log_dose=max(odds, -_MOST))  # fmt: skip


def _honest(off: se2.Array, cov: se2.Array) -> float:
    """Log density of an offset (3,) of a pose that is known as well as that."""
    white = np.linalg.solve(np.linalg.cholesky(cov), off)
    size = float(np.linalg.slogdet(cov)[1])
    return float(-0.5 * (white @ white + size) - 1.5 * np.log(2.0 * np.pi))


def _mistaken(metres: float, turn: float) -> float:
    """Log density of an offset that somebody did not notice: some metres, any heading."""
    away = student(np.array([metres / _MISTAKE_M]), 2) - 2.0 * np.log(_MISTAKE_M)
    return float((away + student(np.array([turn]), 1))[0])


def motions(incident: Incident, healed: Healed) -> Iterator[Trial]:
    """Odometry as it was recorded, where it slipped, where it was carried, and all along."""
    if not incident.has_odometry:
        return
    if healed.slips:
        yield from _slipped(incident, healed)
    wheels = incident.case.wheels
    if wheels is not None and wheels.calibration_words:
        told = replace(healed.evidence, odometry=healed.odometry_of(healed.steps_but_slips))
        level = 1.0 if wheels.scale is None else wheels.scale
        name, words = "odometry_scale.translation", wheels.calibration_words[0]
        yield Trial(name, "odometry_slip", level, "ratio", None, words, told)


def _slipped(incident: Incident, healed: Healed) -> Iterator[Trial]:
    """Where odometry and hindsight part: by wheels that slipped, or by hand."""
    steps = healed.steps.copy()
    for s in healed.slips:
        steps[s.first : s.last] = healed.told_steps[s.first : s.last]
    # What began last before the loss has most to do with it.
    before = [s for s in healed.slips if incident.t_ns[s.first] <= incident.onset_ns]
    worst = max(before or healed.slips, key=lambda s: s.metres + abs(s.radians))
    since = incident.case.seconds(int(incident.t_ns[worst.first]))
    far = apart(worst.metres, abs(worst.radians))
    words = f"odometry as recorded from {since} on, {far} otherwise than the robot moved"
    told = replace(healed.evidence, odometry=healed.odometry_of(steps))
    odds, row = worst.log_carried, worst.first
    name, level, unit = _dose(worst)
    yield Trial(name, "odometry_slip", level, unit, row, words, told, log_dose=-odds)
    yield Trial(name, "kidnapped", level, unit, row, words, told, log_dose=odds)


def _dose(slip: Slip) -> tuple[str, float, str]:
    """What it is as a perturbation: way or turn that was told and not made, its size and unit."""
    told_m = slip.counted_m - slip.moved_m
    if abs(slip.radians) > np.radians(20.0) and abs(told_m) < 0.5:
        return "odometry_slip.turn", float(-np.degrees(slip.radians)), "deg"
    return "odometry_slip.window", float(told_m), "m"
