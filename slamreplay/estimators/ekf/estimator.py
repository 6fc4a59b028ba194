"""The filter as estimators: with settings as they are given, and as the log makes them likely."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.fixes import SatelliteFixes, fixes_in_map
from slamreplay.bundle.run import Estimate, Innovations
from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.sightings import sightings_of
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.estimators.ekf import kernels
from slamreplay.estimators.ekf.filter import filtered, gates_of
from slamreplay.estimators.ekf.gyro import gyro_of
from slamreplay.estimators.ekf.node.parameters import (
    LIVE,
    NAMES,
    NodeParameters,
    names_of_inputs,
    node_parameters,
)
from slamreplay.estimators.ekf.node.run import run_node
from slamreplay.estimators.ekf.noise import Noise
from slamreplay.estimators.ekf.observations import Observations, after_motion, observations_of
from slamreplay.estimators.ekf.own_parameters import numbers_of
from slamreplay.estimators.ekf.passing import Evidence, Filtered, Held
from slamreplay.estimators.ekf.tuning import tuned
from slamreplay.estimators.inputs import need_odometry
from slamreplay.estimators.scales import MEASUREMENT_NOISE, PROCESS_NOISE, scales_of
from slamreplay.estimators.start import DEFAULT_COV, GLOBAL, MOVED, Start, starts

#: Settings a perturbation may change: of the start, and ratios of the covariances that it is told.
SETTINGS = MOVED | {GLOBAL, PROCESS_NOISE, MEASUREMENT_NOISE}
#: Names that nodes of robot_localization have in its own files, and often elsewhere.
NODES = (
    "ekf", "ekf_node", "ekf_filter_node", "ekf_localization", "ekf_localization_node", "ekf_se",
    "ekf_filter_node_odom", "ekf_filter_node_map", "ekf_se_odom", "ekf_se_map",
    "ekf_localization_odom", "ekf_localization_map", "robot_localization",
)  # fmt: skip
#: Axes of the innovations: what they measure and its unit.
AXES = ("range m", "bearing rad", "heading rad")
NEAR_AXES = ("x m", "y m", "heading rad")
FIX_AXES, TURN_AXES = ("x m", "y m"), ("turn rad",)


@dataclass(frozen=True)
class Ekf:
    """Carry the pose by odometry and gyroscope, and correct it by what is seen of surveyed places.

    That are tags, docks and reflectors that static transforms tie to the map, and satellite fixes
    in a frame that they tie to it. It starts from the initial pose in the log, else from the first
    recorded belief; where there is neither, and where it has been lost for some seconds, it places
    itself by the sightings alone. Without a start and without sightings it carries odometry on from
    zero, in the odometry's own frame. What each of its inputs came to is in the scalars.

    Attributes:
        noise: what it is told of its sensors.
        gate_probability: with which it takes in a measurement that its model describes; others are
            rejected by their NIS.
        update_min_d: a thing is taken in again after driving this far, m,
        update_min_a: or turning by this much, rad.
        node: parameters of an `ekf_node` of robot_localization: it is replayed with the inputs that
            they choose, and nothing of the above counts; None for the filter of this project.
    """

    noise: Noise = field(default_factory=Noise)
    gate_probability: float = 0.999
    update_min_d: float = 0.01
    update_min_a: float = 0.01
    node: NodeParameters | None = None

    name: ClassVar[str] = "ekf"
    needs: ClassVar[frozenset[str]] = frozenset({"odometry"})
    settings: ClassVar[frozenset[str]] = SETTINGS
    parameter_nodes: ClassVar[tuple[str, ...]] = NODES
    parameter_names: ClassVar[frozenset[str]] = NAMES
    live_parameters: ClassVar[tuple[str, ...]] = LIVE

    @classmethod
    def from_parameters(cls, given: Mapping[str, object]) -> Self:
        """With the parameters of an `ekf_node` of robot_localization, or of this filter.

        Those of a node are known by its inputs (`odom0`, `imu0`, ...). Those of this filter are
        its attributes and those of its noise, by their own names.

        Raises:
            UsageError: a parameter that there is not (with the nearest one), or a value that it
                cannot have.
        """
        if names_of_inputs(given):
            return cls(node=node_parameters(given))
        own, noise = numbers_of(cls, given, cls.name, ("odom0", "imu0", "pose0", "twist0"))
        gates_of(own.get("gate_probability", cls.gate_probability))
        return cls(noise=noise, **own)

    def run(self, view: BundleView, *, seed: int) -> Estimate:  # noqa: ARG002 - nothing is random
        """One row per scan (per odometry sample without scans), NaN where there is no pose.

        Diagnostics: `updated` (1 where a sighting or fix was taken in since the row before).
        Scalars: measurements by what became of them, how often the filter placed itself, and with a
        gyroscope what was found at the end: its bias, `gyro_bias` in rad/s, and by which share of
        them wheels tell turns too small, `wheels_lack_of_turns`; `imu_left_out` is 1 where an
        inertial unit measures no turns, or nothing says which way is up in it.

        Raises:
            NotApplicableError: no odometry; or it is to start anywhere, and has no sighting of
                anything with a surveyed place. Of a node: none of its inputs is there.
        """
        if self.node is not None:
            return run_node(view, self.node, self.name, *scales_of(view))
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
    needs: ClassVar[frozenset[str]] = frozenset({"odometry", "sightings"})
    settings: ClassVar[frozenset[str]] = SETTINGS
    without_noise: ClassVar[str] = "it fits its noise to the log, and a few seconds cannot tell it"

    def run(self, view: BundleView, *, seed: int) -> Estimate:  # noqa: ARG002 - nothing is random
        """As of the filter; scalars hold what was fitted, too, `fitted.range_per_m` for one.

        Raises:
            NotApplicableError: no odometry, or no sighting of anything with a surveyed place.
        """
        gates = gates_of(self.gate_probability)
        plain = evidence_of(replace(view, settings=MappingProxyType({})), self)
        if not len(plain.observations):
            raise _without_survey(self.name, sightings_of(view, plain.odometry) is None)
        fit = tuned(plain, gates)
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
        NotApplicableError: no odometry, or a start anywhere without a sighting of anything with a
            surveyed place.
    """
    odometry = need_odometry(view, estimator.name)
    sightings = sightings_of(view, odometry)
    scans = scan_set(view)
    row_ns = odometry.t_ns if scans is None else scans.t_ns
    T_odom_base = odometry.at(row_ns).xyyaw
    given = starts(view, row_ns, T_odom_base)
    seen = Observations.none() if sightings is None else observations_of(sightings)
    least = estimator.update_min_d, estimator.update_min_a
    seen = seen.of_moving(odometry, *least)
    known = np.flatnonzero(np.isfinite(T_odom_base).all(axis=1))
    frame = view.manifest.frames.map or "map"
    if not given and len(known) and len(seen):
        given = [Start(int(known[0]), None, DEFAULT_COV)]
    elif not given and len(known):
        frame, given = odometry.frame_id, [Start(int(known[0]), np.zeros(3), np.zeros((3, 3)))]
    elif given and given[0].xyyaw is None and not len(seen):
        raise _without_survey(estimator.name, sightings is None)
    fixes = None if frame == odometry.frame_id else _of_moving(fixes_in_map(view), odometry, *least)
    return Evidence(odometry, seen, row_ns, given, gyro_of(view), fixes, frame)


def _without_survey(where: str, nothing_seen: bool) -> NotApplicableError:
    what = "sightings of tags or docks" if nothing_seen else "a survey of what it sighted"
    hint = "static transforms from the map to the things say where they are"
    return NotApplicableError(f"needs {what}, and the log has none", where=where, hint=hint)


def _of_moving(
    fixes: SatelliteFixes | None, odometry: PoseTrack, least_m: float, least_rad: float
) -> SatelliteFixes | None:
    """Fixes that come after some motion: at rest a receiver errs the same way for minutes."""
    if fixes is None:
        return None
    keep = after_motion(fixes.t_ns, np.zeros(len(fixes), dtype=np.int64), 1, odometry, least_m,
                        least_rad)  # fmt: skip
    return replace(fixes, t_ns=fixes.t_ns[keep], xy=fixes.xy[keep], cov=fixes.cov[keep])


def estimate_of(view: BundleView, evidence: Evidence, done: Filtered) -> Estimate:
    """The filter's rows, innovations and counts."""
    base = view.manifest.frames.base or evidence.odometry.child_frame_id
    track = PoseTrack(evidence.frame_id, base, evidence.row_ns, done.xyyaw, done.cov)
    seen = evidence.observations
    scalars = {
        **_counts("sightings", done.sighted),
        "sightings_before_start": float((done.status == kernels.UNUSED).sum()) - done.silent,
        "sightings_without_odometry": float(done.silent),
        "sightings_without_survey": float(seen.unsurveyed),
        "sightings_without_motion": float(seen.repeated),
        "located_by_sightings": float(done.located),
        "recoveries": float(done.recoveries),
    }
    if evidence.fixes is not None:
        scalars |= _counts("fixes", done.fixed)
    if evidence.gyro is not None:
        found = dict(zip(("wheels_lack_of_turns", "gyro_bias"), done.turns.tolist(), strict=True))
        scalars |= {**_counts("wheel_turns", done.turned), **found}
    elif view.role("imu") is not None:
        scalars["imu_left_out"] = 1.0
    innovations = _innovations(evidence, done, track.frame_id, base)
    return Estimate(track, innovations, {"updated": done.updated}, scalars)


def _counts(what: str, held: Held) -> dict[str, float]:
    return {
        f"{what}_accepted": float((held.status == kernels.ACCEPTED).sum()),
        f"{what}_rejected": float((held.status == kernels.REJECTED).sum()),
    }


def _innovations(
    evidence: Evidence, done: Filtered, frame: str, base: str
) -> tuple[Innovations, ...]:
    """A set for each kind of thing and its axes, for fixes, and for the wheels' turns."""
    seen = evidence.observations
    used = done.status != kernels.UNUSED
    sets = []
    for kind in sorted(set(seen.kind.tolist())):
        for near, m in ((False, 2), (False, 3), (True, 2), (True, 3)):
            of_kind = (seen.kind == kind) & (seen.is_near == near) & (seen.dims == m)
            rows = np.flatnonzero(used & of_kind)
            source = f"{'near ' * near}{kind}{' with heading' * (m == 3)}"
            axes, about = (NEAR_AXES if near else AXES)[:m], seen.names[seen.thing[rows]]
            in_axes = frame if near and m == 3 else base
            sets.append(_set(source, done.sighted, rows, axes, in_axes, about))
    if evidence.fixes is not None:
        rows = np.flatnonzero(done.fixed.status != kernels.UNUSED)
        about = np.full(len(rows), evidence.fixes.topic)
        sets.append(_set("gnss", done.fixed, rows, FIX_AXES, frame, about))
    rows = np.flatnonzero(done.turned.status != kernels.UNUSED)
    wheels = np.full(len(rows), evidence.odometry.frame_id)
    sets.append(_set("odometry", done.turned, rows, TURN_AXES, base, wheels))
    return tuple(one for one in sets if len(one.t_ns))


def _set(
    source: str,
    held: Held,
    rows: NDArray[np.int64],
    axes: tuple[str, ...],
    frame: str,
    about: NDArray[np.str_],
) -> Innovations:
    m = len(axes)
    return Innovations(
        source,
        held.t_ns[rows],
        held.residual[rows, :m],
        held.S[rows, :m, :m],
        held.status[rows] == kernels.ACCEPTED,
        axes,
        frame,
        held.moved[rows],
        about,
    )
