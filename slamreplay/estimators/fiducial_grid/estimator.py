"""Codes in the floor and odometry, as an estimator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from slamreplay.bundle.run import Estimate
from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.sightings import sightings_of
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError, UsageError
from slamreplay.estimators.ekf.estimator import SETTINGS, estimate_of
from slamreplay.estimators.ekf.filter import filtered, gates_of
from slamreplay.estimators.ekf.gyro import gyro_of
from slamreplay.estimators.ekf.kernels import ACCEPTED
from slamreplay.estimators.ekf.noise import Noise
from slamreplay.estimators.ekf.own_parameters import numbers_of
from slamreplay.estimators.ekf.passing import Evidence
from slamreplay.estimators.fiducial_grid.codes import CodeNoise, codes_of
from slamreplay.estimators.fiducial_grid.lattice import Lattice, lattice_of
from slamreplay.estimators.inputs import need_odometry
from slamreplay.estimators.scales import scales_of
from slamreplay.estimators.start import DEFAULT_COV, Start, starts
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S

#: Of poses where no code is surveyed: the lattice's own frame.
FRAME = "fiducial_grid"


@dataclass(frozen=True)
class FiducialGrid:
    """Carry the pose by wheels and gyroscope, and take in x, y and heading of every code read.

    A code lies where static transforms tie it to the map; where codes follow a lattice, their
    numbers tell the others' places, in the map of those that are surveyed or, where none is, in a
    frame of the lattice. Codes without a place are counted and not used. A misread code is far off
    and is rejected by its NIS; while codes are hidden the covariance grows, and the next one pulls
    the pose back in one update. It places itself by the codes where no start is known, or where all
    that it reads has been rejected for ten seconds.

    Attributes:
        code_m: standard deviation of where a code is read along each axis, m,
        code_rad: and how it is turned, rad; of one within half a metre.
        spacing_m: from one code to the next, m; 0 has it found in the log,
        columns: numbers to a row; 0 has it found in the log.
        noise: of odometry, gyroscope, and tags that are farther away.
        gate_probability: with which a code that is read rightly is taken in.
        update_min_d: a code is taken in again after driving this far, m,
        update_min_a: or turning by this much, rad.
    """

    code_m: float = 0.005
    code_rad: float = 0.01
    spacing_m: float = 0.0
    columns: int = 0
    noise: Noise = field(default_factory=Noise)
    gate_probability: float = 0.999
    update_min_d: float = 0.02
    update_min_a: float = 0.02

    name: ClassVar[str] = "fiducial_grid"
    needs: ClassVar[frozenset[str]] = frozenset({"odometry", "sightings"})
    settings: ClassVar[frozenset[str]] = SETTINGS
    #: Spacing and columns are read off the whole log unless they are given.
    causal: ClassVar[bool] = False

    def __post_init__(self) -> None:
        for name in ("code_m", "code_rad"):
            if not getattr(self, name) > 0.0:
                raise UsageError(
                    f"{name} is {getattr(self, name)}", where=self.name, hint="above 0"
                )
        for name in ("spacing_m", "columns"):
            if not getattr(self, name) >= 0.0:
                value = getattr(self, name)
                raise UsageError(f"{name} is {value}", where=self.name, hint="not negative")

    @classmethod
    def from_parameters(cls, given: Mapping[str, object]) -> Self:
        """With attributes of this estimator and of its noise, by their names.

        Raises:
            UsageError: a parameter that there is not (with the nearest one), or a value that it
                cannot have.
        """
        own, noise = numbers_of(cls, given, cls.name)
        if "columns" in own:
            own["columns"] = int(own["columns"])
        return cls(noise=noise, **own)

    def run(self, view: BundleView, *, seed: int) -> Estimate:  # noqa: ARG002 - nothing is random
        """One row per scan (per odometry sample without scans), NaN where there is no pose.

        Diagnostics and innovations as of `ekf`, the codes' in x, y and heading. Scalars: codes by
        what became of them, `lattice_spacing_m`, `lattice_columns` and `lattice_share` of the ways
        between codes that agree with it, and `longest_without_code_s`.

        Raises:
            NotApplicableError: no odometry, no codes, or none with a known place.
        """
        odometry = need_odometry(view, self.name)
        sightings = sightings_of(view, odometry)
        if sightings is None:
            raise NotApplicableError(
                "needs codes that were read, and the log has none", where=self.name
            )
        given_spacing = self.spacing_m or None, self.columns or None
        lattice = lattice_of(sightings, odometry, *given_spacing)
        places, frame = _places(sightings.surveyed, lattice)
        if not places:
            hint = "static transforms from the map to the codes say where they are"
            what = "needs places of the codes: no survey, and their numbers follow no lattice"
            raise NotApplicableError(what, where=self.name, hint=hint)
        frame = frame or view.manifest.frames.map or "map"
        codes = codes_of(sightings, places, CodeNoise(self.code_m, self.code_rad))
        codes = codes.of_moving(odometry, self.update_min_d, self.update_min_a)
        scans = scan_set(view)
        row_ns = odometry.t_ns if scans is None else scans.t_ns
        T_odom_base = odometry.at(row_ns).xyyaw
        given = [] if frame == FRAME else starts(view, row_ns, T_odom_base)
        known = np.flatnonzero(np.isfinite(T_odom_base).all(axis=1))
        if not given and len(known):
            given = [Start(int(known[0]), None, DEFAULT_COV)]
        evidence = Evidence(odometry, codes, row_ns, given, gyro_of(view), None, frame)
        gates = gates_of(self.gate_probability)
        done = filtered(evidence, self.noise, gates, *scales_of(view))
        estimate = estimate_of(view, evidence, done)
        scalars = {k.replace("sightings", "codes"): v for k, v in estimate.scalars.items()}
        if lattice is not None:
            scalars["lattice_spacing_m"] = lattice.spacing_m
            scalars["lattice_columns"] = float(lattice.columns)
            scalars["lattice_share"] = lattice.share
        taken = codes.t_ns[done.status == ACCEPTED]
        ends = np.concatenate([row_ns[:1], taken, row_ns[-1:]])
        scalars["longest_without_code_s"] = float(np.diff(ends).max(initial=0)) / NS_PER_S
        sets = tuple(
            replace(one, source=one.source.removeprefix("near ")) for one in estimate.innovations
        )
        return replace(estimate, innovations=sets, scalars=scalars)


def _places(
    surveyed: Mapping[str, se2.Array], lattice: Lattice | None
) -> tuple[dict[str, se2.Array], str]:
    """Poses (3,) of codes by name, and the frame they are in; empty means the map."""
    if not surveyed:
        return ({}, "") if lattice is None else (lattice.places(), FRAME)
    others = None if lattice is None else lattice.placed(surveyed)
    return {**(others or {}), **surveyed}, ""
