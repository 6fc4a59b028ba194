"""What can be put into the filter: too much trust, a wrong match, no correction at all."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from slamreplay.estimators.amcl.laser import Beams
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.rootcause.first_pose import START_COV
from slamreplay.rootcause.healing import Healed
from slamreplay.rootcause.incident import Incident
from slamreplay.rootcause.trial import Trial

#: Process noise of a filter that trusts itself too much, as a share of nav2_amcl's variances, and
#: its particles.
_TRUSTS, _FEW = (0.03, 0.003, 0.0005), 70
#: A step of the belief that neither robot nor wheels made, m or rad in all, so long before the
#: onset and after it.
_JUMP, _BEFORE_NS, _AFTER_NS = 0.2, 5 * NS_PER_S, NS_PER_S
#: Where it jumped to is taken from what was seen: of all places within some metres and headings,
#: nats, that one was chosen.
_CHOSEN = -8.0


def trusts(incident: Incident, healed: Healed) -> Iterator[Trial]:
    """A filter with little noise and few particles, on odometry with the errors it always has."""
    if not np.isfinite(incident.cov).all(axis=(1, 2)).any():
        return
    config = healed.evidence.config
    odometry = healed.odometry_of(healed.steps_but_slips)
    for ratio in _TRUSTS:
        noise = {f"alpha{k}": ratio * getattr(config, f"alpha{k}") for k in range(1, 6)}
        sure = replace(config, **noise, min_particles=_FEW, max_particles=_FEW)
        told = replace(healed.evidence, config=sure, odometry=odometry)
        words = f"a filter that takes {ratio:g} of the process noise, with {_FEW} particles"
        yield Trial(
            "process_noise_scale.covariance", "overconfidence", ratio, "ratio", None, words, told
        )


def uncorrected(incident: Incident, healed: Healed) -> Iterator[Trial]:
    """Nothing that takes errors of motion out."""
    if not incident.has_odometry:
        return
    blind = tuple(None if one is None else _nothing(one) for one in healed.evidence.beams)
    odometry = healed.odometry_of(healed.told_steps)
    told = replace(healed.evidence, odometry=odometry, beams=blind)
    words = "small errors of motion that no scan took out"
    yield Trial("", "optimization_drift", None, "", None, words, told)


def _nothing(beams: Beams) -> Beams:
    return replace(beams, bearings=np.zeros(0), ranges_m=np.zeros(0))


def jumps(incident: Incident, healed: Healed) -> Iterator[Trial]:
    """The belief's largest step that neither the robot nor its wheels made."""
    t, belief = incident.t_ns, incident.belief
    rows = np.flatnonzero(np.isfinite(belief).all(axis=1))
    if len(rows) < 2:
        return
    path = healed.odometry_of(healed.steps)
    own = se2.between(belief[rows[:-1]], belief[rows[1:]])
    made = se2.between(path[rows[:-1]], path[rows[1:]])
    off = se2.between(made, own)
    size = np.hypot(off[:, 0], off[:, 1]) + np.abs(se2.wrap_angle(off[:, 2]))
    at = t[rows[1:]]
    near = (at >= incident.onset_ns - _BEFORE_NS) & (at <= incident.onset_ns + _AFTER_NS)
    if not near.any():
        return
    k = int(np.argmax(np.where(near, size, -1.0)))
    row = int(rows[k + 1])
    if size[k] < _JUMP:
        return
    told = replace(healed.evidence, set_again=((row, belief[row], 0.25 * START_COV),))
    metres = float(np.hypot(off[k, 0], off[k, 1]))
    words = f"one match {metres:.2f} m elsewhere at {incident.case.seconds(int(t[row]))}"
    yield Trial("", "association_error", metres, "m", row, words, told, log_dose=_CHOSEN)
