"""The parameters of nav2_amcl that this filter honours, under their names, with their defaults."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import inf, isfinite, pi, sqrt
from typing import Literal

import numpy as np

from slamreplay.errors import UsageError
from slamreplay.geometry.se2 import Array

#: What may be below zero, and down to where: -1 stands for "of the laser", or "from the trial".
_LEAST = {
    "laser_max_range": -inf,
    "laser_min_range": -inf,
    "initial_pose_x": -inf,
    "initial_pose_y": -inf,
    "initial_pose_yaw": -inf,
    "random_seed": -inf,
}
_ABOVE_ZERO = ("sigma_hit", "lambda_short", "pf_err", "min_particles", "resample_interval")


@dataclass(frozen=True)
class AmclConfig:
    """Parameters by the names of nav2_amcl's configuration page; the defaults are its own.

    https://docs.nav2.org/configuration/packages/configuring-amcl.html

    Attributes:
        alpha1: rotation noise from rotation (variance per squared motion, as alpha2 to alpha5).
        alpha2: rotation noise from translation.
        alpha3: translation noise from translation.
        alpha4: translation noise from rotation.
        alpha5: noise across the motion from translation; of an omnidirectional robot only.
        motion_model: how a robot drives: `differential` turns, drives, turns; `omnidirectional`
            drives any way while it turns.
        squared_motion_noise: take the motion noise's variance for its standard deviation, as ROS
            1's `diff` and `omni` do; `diff-corrected` and `omni-corrected` do not.
        laser_model_type: how a scan weighs a particle.
        z_hit: weight of the Gaussian part of a beam's likelihood.
        z_short: of the beam model's part for what stands before the wall,
        z_max: for beams without a return.
        z_rand: weight of the uniform part, which is spread over the laser's range.
        sigma_hit: standard deviation of the Gaussian part, m.
        lambda_short: decay of the short part, 1/m.
        laser_likelihood_max_dist: distances to walls are cut here, m; off the map it is this.
        laser_max_range: longer returns are ignored, m; not positive means the laser's own maximum.
        laser_min_range: returns not above it are as no return, m; not positive means none is.
        max_beams: evenly spaced beams of a scan that are used; fewer than two use none.
        do_beamskip: leave out beams that most of a converged cloud says do not fit
            (`likelihood_field_prob` only).
        beam_skip_distance: a beam fits a particle if it ends nearer to a wall, m.
        beam_skip_threshold: share of particles that a beam must fit to be used.
        beam_skip_error_threshold: share of beams left out from which on all are used after all.
        min_particles: least particles.
        max_particles: most particles, and as many as a fresh start draws.
        update_min_d: odometry must have moved by more than this along x or y, m.
        update_min_a: or turned by more than this, rad.
        resample_interval: updates between two resamplings.
        selective_resampling: and only where the effective sample size is half the set or less.
        pf_err: largest error between the particle and the true distribution (KLD sampling).
        pf_z: normal quantile of the probability that it stays below `pf_err`.
        recovery_alpha_slow: decay of the slow average likelihood; 0 turns recovery off.
        recovery_alpha_fast: decay of the fast one.
        set_initial_pose: start at the pose below, unless the log has an initial pose before.
        know_initial_pose: or only where the log says of no pose at all, as ROS 1's amcl keeps its
            latest pose under these names: a dump need not be of the log's beginning.
        initial_pose_x: in the map, m.
        initial_pose_y: in the map, m.
        initial_pose_yaw: in the map, rad.
        initial_cov_xx: variance of the pose above, m^2,
        initial_cov_yy: m^2,
        initial_cov_aa: rad^2; nav2_amcl has none, the defaults are its own of a start.
        random_seed: of every random number; below zero it is the trial's.
    """

    alpha1: float = 0.2
    alpha2: float = 0.2
    alpha3: float = 0.2
    alpha4: float = 0.2
    alpha5: float = 0.2
    motion_model: Literal["differential", "omnidirectional"] = "differential"
    squared_motion_noise: bool = False
    laser_model_type: Literal["likelihood_field", "likelihood_field_prob", "beam"] = (
        "likelihood_field"
    )
    z_hit: float = 0.5
    z_short: float = 0.05
    z_max: float = 0.05
    z_rand: float = 0.5
    sigma_hit: float = 0.2
    lambda_short: float = 0.1
    laser_likelihood_max_dist: float = 2.0
    laser_max_range: float = 100.0
    laser_min_range: float = -1.0
    max_beams: int = 60
    do_beamskip: bool = False
    beam_skip_distance: float = 0.5
    beam_skip_threshold: float = 0.3
    beam_skip_error_threshold: float = 0.9
    min_particles: int = 500
    max_particles: int = 2000
    update_min_d: float = 0.25
    update_min_a: float = 0.2
    resample_interval: int = 1
    selective_resampling: bool = False
    pf_err: float = 0.05
    pf_z: float = 0.99
    recovery_alpha_slow: float = 0.0
    recovery_alpha_fast: float = 0.0
    set_initial_pose: bool = False
    know_initial_pose: bool = False
    initial_pose_x: float = 0.0
    initial_pose_y: float = 0.0
    initial_pose_yaw: float = 0.0
    initial_cov_xx: float = 0.25
    initial_cov_yy: float = 0.25
    initial_cov_aa: float = (pi / 12.0) ** 2
    random_seed: int = -1

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, str):
                continue
            if not isfinite(value) or value < _LEAST.get(item.name, 0.0):
                raise UsageError(f"{item.name} is {value}", where="amcl", hint="not negative")
        for name in _ABOVE_ZERO:
            if getattr(self, name) <= 0:
                raise UsageError(f"{name} is {getattr(self, name)}", where="amcl", hint="above 0")
        if self.max_particles < self.min_particles:
            raise UsageError(
                f"max_particles {self.max_particles} is below min_particles {self.min_particles}",
                where="amcl",
            )

    def scaled(self, process: float, measurement: float) -> AmclConfig:
        """The same with variances of motion and of the laser so many times as large.

        The alphas are variances per squared motion, or standard deviations where
        `squared_motion_noise` takes them for such; the laser's is that of `sigma_hit`, whose
        Gaussian has no normaliser: it only grows wider.
        """
        if process == measurement == 1.0:
            return self
        motion = sqrt(process) if self.squared_motion_noise else process
        return replace(
            self,
            alpha1=motion * self.alpha1,
            alpha2=motion * self.alpha2,
            alpha3=motion * self.alpha3,
            alpha4=motion * self.alpha4,
            alpha5=motion * self.alpha5,
            sigma_hit=sqrt(measurement) * self.sigma_hit,
        )

    @property
    def initial_pose(self) -> tuple[Array, Array]:
        """Pose (3,) and covariance (3, 3) that the parameters say."""
        pose = np.array([self.initial_pose_x, self.initial_pose_y, self.initial_pose_yaw])
        return pose, np.diag([self.initial_cov_xx, self.initial_cov_yy, self.initial_cov_aa])
