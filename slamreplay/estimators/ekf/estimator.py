"""The filter as estimators: with settings as they are given, and as the log makes them likely."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from slamreplay.bundle.run import Estimate, Innovations
from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.sightings import sightings_of
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.estimators.ekf import kernels
from slamreplay.estimators.ekf.filter import filtered, gates_of
from slamreplay.estimators.ekf.noise import Noise
from slamreplay.estimators.ekf.observations import observations_of
from slamreplay.estimators.ekf.passing import Evidence, Filtered
from slamreplay.estimators.ekf.tuning import tuned
from slamreplay.estimators.inputs import need_odometry
from slamreplay.estimators.start import DEFAULT_COV, GLOBAL, OFFSET, ROTATE, Start, starts

#: Settings a perturbation may change: ratios of the covariances that the filter is told.
PROCESS_NOISE, MEASUREMENT_NOISE = "process_noise_scale", "measurement_noise_scale"
SETTINGS = frozenset({OFFSET, ROTATE, GLOBAL, PROCESS_NOISE, MEASUREMENT_NOISE})
NEEDS = frozenset({"odometry", "sightings"})
#: Axes of the innovations: what they measure and its unit.
AXES = ("range m", "bearing rad", "heading rad")


@dataclass(frozen=True)
class Ekf:
    """Carry the pose by odometry, and correct it by sightings of things with a surveyed place.

    It starts from the initial pose in the log, else from the first recorded belief; where there is
    neither, and where it has been lost for some seconds, it places itself by the sightings alone.

    Attributes:
        noise: what it is told of its sensors.
        gate_probability: with which it takes in a sighting that its model describes; others are
            rejected by their NIS.
        update_min_d: a thing is taken in again after driving this far, m,
        update_min_a: or turning by this much, rad.
    """

    noise: Noise = field(default_factory=Noise)
    gate_probability: float = 0.999
    update_min_d: float = 0.01
    update_min_a: float = 0.01

    name: ClassVar[str] = "ekf"
    needs: ClassVar[frozenset[str]] = NEEDS
    settings: ClassVar[frozenset[str]] = SETTINGS

    def run(self, view: BundleView, *, seed: int) -> Estimate:  # noqa: ARG002 - nothing is random
        """One row per scan (per odometry sample without scans), NaN where there is no pose.

        Diagnostics: `updated` (1 where a sighting was taken in since the row before). Scalars:
        sightings by what became of them, and how often the filter placed itself.

        Raises:
            NotApplicableError: no odometry, or no sighting of anything with a surveyed place.
        """
        evidence = evidence_of(view, self)
        done = filtered(evidence, self.noise, gates_of(self.gate_probability), *scales_of(view))
        return estimate_of(view, evidence, done)


@dataclass(frozen=True)
class EkfTuned:
    """The same filter with settings that the log itself makes most probable.

    It looks at the whole log first, for its noise and its sensors' constant errors, and never at a
    reference that judges. Settings that a perturbation changes act on what was fitted without it.

    Attributes:
        gate_probability: as the filter's.
        update_min_d: as the filter's, m.
        update_min_a: as the filter's, rad.
    """

    gate_probability: float = 0.999
    update_min_d: float = 0.01
    update_min_a: float = 0.01

    name: ClassVar[str] = "ekf_tuned"
    causal: ClassVar[bool] = False
    needs: ClassVar[frozenset[str]] = NEEDS
    settings: ClassVar[frozenset[str]] = SETTINGS

    def run(self, view: BundleView, *, seed: int) -> Estimate:  # noqa: ARG002 - nothing is random
        """As of the filter; scalars hold what was fitted, too, `fitted.range_per_m` for one.

        Raises:
            NotApplicableError: no odometry, or no sighting of anything with a surveyed place.
        """
        gates = gates_of(self.gate_probability)
        plain = replace(view, settings=MappingProxyType({}))
        fit = tuned(evidence_of(plain, self), gates)
        evidence = evidence_of(view, self)
        estimate = estimate_of(
            view, evidence, filtered(evidence, fit.noise, gates, *scales_of(view))
        )
        fitted = {f"fitted.{name}": float(getattr(fit.noise, name)) for name in fit.fitted}
        fitted["fit.sightings"] = float(fit.sightings)
        if fit.before is not None and fit.after is not None:
            fitted |= {"fit.log_density_before": fit.before, "fit.log_density_after": fit.after}
        return replace(estimate, scalars={**estimate.scalars, **fitted})


def evidence_of(view: BundleView, estimator: Ekf | EkfTuned) -> Evidence:
    """What the filter reads of a view.

    Raises:
        NotApplicableError: no odometry, or no sighting of anything with a surveyed place.
    """
    odometry = need_odometry(view, estimator.name)
    sightings = sightings_of(view, odometry)
    if sightings is None or not sightings.surveyed:
        what = "sightings of tags or docks" if sightings is None else "a survey of what it sighted"
        hint = "static transforms from the map to the things say where they are"
        raise NotApplicableError(
            f"needs {what}, and the log has none", where=estimator.name, hint=hint
        )
    scans = scan_set(view)
    row_ns = odometry.t_ns if scans is None else scans.t_ns
    T_odom_base = odometry.at(row_ns).xyyaw
    given = starts(view, row_ns, T_odom_base)
    known = np.flatnonzero(np.isfinite(T_odom_base).all(axis=1))
    if not given and len(known):
        given = [Start(int(known[0]), None, DEFAULT_COV)]
    seen = observations_of(sightings)
    seen = seen.of_moving(odometry, estimator.update_min_d, estimator.update_min_a)
    return Evidence(odometry, seen, row_ns, given)


def scales_of(view: BundleView) -> tuple[float, float]:
    """Ratios of the covariances of motion and of sightings that a view asks for."""
    return view.settings.get(PROCESS_NOISE, 1.0), view.settings.get(MEASUREMENT_NOISE, 1.0)


def estimate_of(view: BundleView, evidence: Evidence, done: Filtered) -> Estimate:
    """The filter's rows, innovations and counts."""
    frames = view.manifest.frames
    base = frames.base or evidence.odometry.child_frame_id
    track = PoseTrack(frames.map or "map", base, evidence.row_ns, done.xyyaw, done.cov)
    seen = evidence.observations
    scalars = {
        "sightings_accepted": float((done.status == kernels.ACCEPTED).sum()),
        "sightings_rejected": float((done.status == kernels.REJECTED).sum()),
        "sightings_before_start": float((done.status == kernels.UNUSED).sum()) - done.silent,
        "sightings_without_odometry": float(done.silent),
        "sightings_without_survey": float(seen.unsurveyed),
        "sightings_without_motion": float(seen.repeated),
        "located_by_sightings": float(done.located),
        "recoveries": float(done.recoveries),
    }
    return Estimate(track, _innovations(evidence, done), {"updated": done.updated}, scalars)


def _innovations(evidence: Evidence, done: Filtered) -> tuple[Innovations, ...]:
    """A set for each kind of thing and number of axes: "fiducial", "fiducial with heading"."""
    seen = evidence.observations
    used = done.status != kernels.UNUSED
    sets = []
    for kind in sorted(set(seen.kind.tolist())):
        for m in (2, 3):
            rows = np.flatnonzero(used & (seen.kind == kind) & (seen.dims == m))
            if len(rows):
                sets.append(
                    Innovations(
                        kind if m == 2 else f"{kind} with heading",
                        seen.t_ns[rows],
                        done.residual[rows, :m],
                        done.S[rows, :m, :m],
                        done.status[rows] == kernels.ACCEPTED,
                        AXES[:m],
                    )
                )
    return tuple(sets)
