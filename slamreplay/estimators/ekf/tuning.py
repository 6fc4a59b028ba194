"""Settings from the log itself: those under which its sightings are most probable.

No reference is read: what is weighed is how well each sighting was predicted from odometry and the
sightings before it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, minimize

from slamreplay.bundle.track import PoseTrack
from slamreplay.estimators.ekf.filter import filtered
from slamreplay.estimators.ekf.likelihood import log_densities, score_vectors
from slamreplay.estimators.ekf.motion import Motion
from slamreplay.estimators.ekf.noise import Noise
from slamreplay.estimators.ekf.passing import Evidence, Filtered
from slamreplay.estimators.start import Start
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S, ns


@dataclass(frozen=True)
class _Prior:
    """What is expected of a setting before any log: its centre, and how far it may lie from it.

    Attributes:
        centre: of the setting.
        spread: standard deviation, of the logarithm where the setting is a size.
        is_size: whether it is positive and known by its order only.
    """

    centre: float
    spread: float
    is_size: bool = False


#: A log of thousands of sightings overrules these by far; one of ten hardly moves them.
_PRIORS = {
    "position_per_metre": _Prior(0.03, 1.0, is_size=True),
    "heading_per_metre": _Prior(0.03, 1.0, is_size=True),
    "heading_per_turn": _Prior(0.05, 1.0, is_size=True),
    "range_m": _Prior(0.02, 1.0, is_size=True),
    "range_per_m": _Prior(0.02, 1.0, is_size=True),
    "bearing_rad": _Prior(0.01, 1.0, is_size=True),
    "heading_rad": _Prior(0.1, 1.0, is_size=True),
    "stated_ratio": _Prior(1.0, 1.0, is_size=True),
    "lasting_range_per_m": _Prior(0.02, 1.0, is_size=True),
    "lasting_bearing_rad": _Prior(0.005, 1.0, is_size=True),
    "lasting_s": _Prior(5.0, 1.0, is_size=True),
    "range_ratio": _Prior(1.0, 0.03),
    "range_falloff": _Prior(0.0, 0.3),
    "range_axis_rad": _Prior(0.0, 0.1),
    "odometry_delay_s": _Prior(0.0, 0.2),
    "distance_ratio": _Prior(1.0, 0.05),
    "turn_ratio": _Prior(1.0, 0.05),
    "turn_per_metre": _Prior(0.0, 0.05),
}
#: Where the search begins: rather too wide, so that the filter is not lost on its way.
_CAUTIOUS = replace(
    Noise(),
    position_per_metre=0.05,
    heading_per_metre=0.1,
    heading_per_turn=0.1,
    range_m=0.02,
    range_per_m=0.02,
    bearing_rad=0.01,
    lasting_range_per_m=0.03,
    lasting_bearing_rad=0.005,
)
#: Differences are taken over this share of a spread.
_STEP = 0.03
#: A search ends after so many rounds, or `_PATIENCE` of them in a row that gained less than this.
_ROUNDS, _GAIN, _PATIENCE = 30, 1.0, 3
#: It is begun again where it ended, at most so often, and no more once that gains less than this.
_RESTARTS, _RESTART_GAIN = 3, 5.0
#: Delays that can be found: sightings this near to a gap of odometry are not weighed.
_LONGEST_DELAY_S = 0.6
#: Odometry is thinned to this period: the filter's noise does not depend on it.
_PERIOD_NS = NS_PER_S // 20


@dataclass(frozen=True)
class Tuned:
    """What a log says of its own noise.

    Attributes:
        noise: the settings.
        fitted: names of those that were fitted.
        sightings: how many were weighed.
        before: mean log density of a sighting under the cautious settings at the start; None
            where none was weighed.
        after: under the fitted ones.
    """

    noise: Noise
    fitted: tuple[str, ...]
    sightings: int
    before: float | None
    after: float | None


def tuned(evidence: Evidence, gates: se2.Array) -> Tuned:
    """The most probable settings, given a log and how such settings usually are.

    Maximum likelihood of the prediction errors (see `likelihood`) with a weak prior, by Fisher
    scoring within a trust region; the same log gives the same bits.

    Args:
        evidence: of the log.
        gates: (4,) largest NIS of a sighting that is taken in.
    """
    search = _Search(_from_a_fixed_start(evidence, gates), gates)
    if not search.weighed.any():
        return Tuned(_CAUTIOUS, (), 0, None, None)
    first = x = search.coordinates(_CAUTIOUS)
    cost = np.inf
    for restart in range(_RESTARTS):
        # The cost has small steps, where a sighting comes to be rejected: differences to the other
        # side find a way on where the search has run into one.
        search.step = _STEP if restart % 2 == 0 else -_STEP
        found = minimize(
            search.cost,
            x,
            method="trust-exact",
            jac=lambda at: search.slope(at)[0],
            hess=lambda at: search.slope(at)[1],
            callback=_until_little_is_gained(),
            options={"maxiter": _ROUNDS, "initial_trust_radius": 1.0, "max_trust_radius": 8.0},
        )
        gained, cost, x = cost - found.fun, found.fun, found.x
        if restart > 0 and gained < _RESTART_GAIN:
            break
    n = int(search.weighed.sum())
    before, after = (search.log_likelihood(at, search.pass_of(at)) / n for at in (first, x))
    return Tuned(search.noise(x), search.names, n, before, after)


class _Search:
    """The cost of settings, by coordinates in which their prior is a unit normal."""

    def __init__(self, evidence: Evidence, gates: se2.Array) -> None:
        self._evidence, self._gates = evidence, gates
        self.names = _fitted_names(evidence)
        self.weighed = _far_from_gaps(evidence)
        self.step = _STEP
        self._motions: dict[tuple[float, float, float], Motion] = {}
        self._slope: tuple[bytes, tuple[se2.Array, se2.Array]] | None = None

    def coordinates(self, noise: Noise) -> se2.Array:
        """(P,) of settings."""
        found = []
        for name in self.names:
            prior, value = _PRIORS[name], getattr(noise, name)
            off = np.log(value / prior.centre) if prior.is_size else value - prior.centre
            found.append(off / prior.spread)
        return np.array(found)

    def noise(self, x: se2.Array) -> Noise:
        """The settings at coordinates (P,); sizes are kept within a factor of e^8."""
        values = {}
        for name, off in zip(self.names, np.clip(x, -8.0, 8.0).tolist(), strict=True):
            prior = _PRIORS[name]
            away = prior.spread * off
            size = prior.centre * np.exp(away) if prior.is_size else prior.centre + away
            values[name] = float(max(size, 0.1) if name.endswith("_ratio") else size)
        return replace(_CAUTIOUS, **values)

    def pass_of(self, x: se2.Array) -> Filtered:
        """One pass of the filter."""
        noise = self.noise(x)
        key = noise.distance_ratio, noise.turn_ratio, noise.turn_per_metre
        if key not in self._motions:
            if len(self._motions) > 4:
                self._motions.pop(next(iter(self._motions)))
            self._motions[key] = Motion(self._evidence.odometry, noise)
        return filtered(self._evidence, noise, self._gates, motion=self._motions[key])

    def log_likelihood(self, x: se2.Array, done: Filtered) -> float:
        """Of the sightings that are weighed, in a pass at coordinates (P,)."""
        densities = log_densities(self._evidence.observations, done, self.noise(x))
        return float(densities[self.weighed].sum())

    def cost(self, x: se2.Array) -> float:
        """What is made small: minus the logarithm of likelihood and prior."""
        return float(0.5 * x @ x) - self.log_likelihood(x, self.pass_of(x))

    def slope(self, x: se2.Array) -> tuple[se2.Array, se2.Array]:
        """(P,) derivative of the cost, and (P, P) its expected second derivative."""
        key = x.tobytes() + np.float64(self.step).tobytes()
        if self._slope is None or self._slope[0] != key:
            here = self.pass_of(x)
            places = x + self.step * np.eye(len(x))
            others = [self.pass_of(place) for place in places]
            values = [self.log_likelihood(at, o) for at, o in zip(places, others, strict=True)]
            gain = (np.array(values) - self.log_likelihood(x, here)) / self.step
            vectors = score_vectors(self._evidence.observations, here, others, self.step)
            self._slope = key, (x - gain, np.eye(len(x)) + vectors @ vectors.T)
        return self._slope[1]


def _fitted_names(evidence: Evidence) -> tuple[str, ...]:
    """The settings that the log's sightings say something of."""
    seen = evidence.observations
    told = np.isfinite(seen.stated[:, 0, 0])
    told_heading = np.isfinite(seen.stated[:, 2, 2]) | (seen.dims == 2)
    without = set()
    if told.all():
        without |= {"range_m", "range_per_m", "bearing_rad"}
    if told_heading.all():
        without |= {"heading_rad"}
    if not told.any() and not (np.isfinite(seen.stated[:, 2, 2]) & (seen.dims == 3)).any():
        without |= {"stated_ratio"}
    return tuple(name for name in _PRIORS if name not in without)


def _far_from_gaps(evidence: Evidence) -> NDArray[np.bool_]:
    """(M,) sightings at which odometry is known whatever its delay."""
    t_ns, reach = evidence.observations.t_ns, ns(_LONGEST_DELAY_S)
    known = [evidence.odometry.at(t_ns + off).has_pose for off in (-reach, 0, reach)]
    return np.asarray(np.logical_and.reduce(known))


def _from_a_fixed_start(evidence: Evidence, gates: se2.Array) -> Evidence:
    """The same start for all settings, and odometry at the period that is enough.

    Where the filter has to find its start, it is found once, with cautious settings.
    """
    evidence = replace(evidence.of_starts(), odometry=_thinned(evidence.odometry))
    if not evidence.given or evidence.given[0].xyyaw is not None:
        return evidence
    t_ns = evidence.observations.t_ns
    rows = np.flatnonzero(t_ns >= evidence.row_ns[0])
    alone = replace(evidence, row_ns=t_ns[rows], given=[replace(evidence.given[0], row=0)])
    done = filtered(alone, _CAUTIOUS, gates)
    found = np.flatnonzero(np.isfinite(done.xyyaw[:, 0]))
    if not len(found):
        return evidence
    first_ns = t_ns[rows[found[0]]] + 1  # the sightings that made it are not held against it
    later = [start for start in evidence.given[1:] if evidence.row_ns[start.row] > first_ns]
    starts = [Start(0, done.xyyaw[found[0]], done.cov[found[0]])]
    starts += [replace(start, row=k + 1) for k, start in enumerate(later)]
    row_ns = np.array([first_ns, *(evidence.row_ns[start.row] for start in later)], dtype=np.int64)
    return replace(evidence, row_ns=row_ns, given=starts)


def _thinned(track: PoseTrack) -> PoseTrack:
    """A row for each period, gaps and their edges as they are."""
    slot = (track.t_ns - track.t_ns[:1]) // _PERIOD_NS
    keep = np.append(True, np.diff(slot) > 0)
    gap = np.diff(track.t_ns) > 4 * _PERIOD_NS
    keep[1:] |= gap
    keep[:-1] |= gap
    keep[-1:] = True
    return track.take(keep)


def _until_little_is_gained() -> Callable[[OptimizeResult], None]:
    """A callback that ends the search."""
    best, idle = np.inf, 0

    def callback(intermediate_result: OptimizeResult) -> None:
        nonlocal best, idle
        idle = 0 if best - intermediate_result.fun > _GAIN else idle + 1
        best = min(best, intermediate_result.fun)
        if idle > _PATIENCE:
            raise StopIteration

    return callback
