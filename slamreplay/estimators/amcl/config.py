"""The parameters of nav2_amcl that this filter honours, under their names, with their defaults."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import isfinite

from slamreplay.errors import UsageError


@dataclass(frozen=True)
class AmclConfig:
    """Parameters by the names of nav2_amcl's configuration page; the defaults are its own.

    Attributes:
        alpha1: rotation noise from rotation (variance per squared motion, as alpha2 to alpha4).
        alpha2: rotation noise from translation.
        alpha3: translation noise from translation.
        alpha4: translation noise from rotation.
        z_hit: weight of the Gaussian part of a beam's likelihood.
        z_rand: weight of its uniform part, which is spread over the laser's range.
        sigma_hit: standard deviation of the Gaussian part, m.
        laser_likelihood_max_dist: distances to walls are cut here, m; off the map it is this.
        laser_max_range: longer returns are ignored, m; not positive means the laser's own maximum.
        max_beams: evenly spaced beams of a scan that are used; fewer than two use none.
        min_particles: least particles.
        max_particles: most particles, and as many as a fresh start draws.
        update_min_d: odometry must have moved by more than this along x or y, m.
        update_min_a: or turned by more than this, rad.
        resample_interval: updates between two resamplings.
        pf_err: largest error between the particle and the true distribution (KLD sampling).
        pf_z: normal quantile of the probability that it stays below `pf_err`.
        recovery_alpha_slow: decay of the slow average likelihood; 0 turns recovery off.
        recovery_alpha_fast: decay of the fast one.
    """

    alpha1: float = 0.2
    alpha2: float = 0.2
    alpha3: float = 0.2
    alpha4: float = 0.2
    z_hit: float = 0.5
    z_rand: float = 0.5
    sigma_hit: float = 0.2
    laser_likelihood_max_dist: float = 2.0
    laser_max_range: float = 100.0
    max_beams: int = 60
    min_particles: int = 500
    max_particles: int = 2000
    update_min_d: float = 0.25
    update_min_a: float = 0.2
    resample_interval: int = 1
    pf_err: float = 0.05
    pf_z: float = 0.99
    recovery_alpha_slow: float = 0.0
    recovery_alpha_fast: float = 0.0

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            may_be_negative = item.name == "laser_max_range"
            if not isfinite(value) or (value < 0 and not may_be_negative):
                raise UsageError(f"{item.name} is {value}", where="amcl", hint="not negative")
        for name in ("sigma_hit", "pf_err", "min_particles", "resample_interval"):
            if getattr(self, name) <= 0:
                raise UsageError(f"{name} is {getattr(self, name)}", where="amcl", hint="above 0")
        if self.max_particles < self.min_particles:
            raise UsageError(
                f"max_particles {self.max_particles} is below min_particles {self.min_particles}",
                where="amcl",
            )
