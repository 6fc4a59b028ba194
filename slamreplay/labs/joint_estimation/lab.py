"""What a recipe sets of the yard, and the logs that answer it."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from slamreplay.labs.joint_estimation.drive import Noise, drive
from slamreplay.labs.joint_estimation.pages import results
from slamreplay.labs.joint_estimation.trials import estimated
from slamreplay.labs.lab import Lab, LabResults, Progress

Metres = Annotated[float, Field(gt=0.0, le=1e3)]
Sigma = Annotated[float, Field(ge=1e-4, le=1.0)]


class JointEstimation(Lab):
    """Mapping and localization in sequence against jointly, over the same logs."""

    length_m: Metres
    step_m: Metres
    landmarks: Annotated[int, Field(ge=3, le=500)]
    reach_m: Metres
    odometry_sigma_m: Sigma
    odometry_sigma_rad: Sigma
    range_sigma_m: Sigma
    bearing_sigma_rad: Sigma
    logs: Annotated[int, Field(ge=2, le=2000)]

    @model_validator(mode="after")
    def _fits(self) -> JointEstimation:
        if not 10 <= self.length_m / self.step_m <= 2000:
            raise ValueError("length_m should be 10 to 2000 times step_m")
        return self

    def run(self, seed: int, progress: Progress | None = None) -> LabResults:
        """Drive each log once, and estimate it in every way."""
        noise = Noise(
            self.odometry_sigma_m,
            self.odometry_sigma_rad,
            self.range_sigma_m,
            self.bearing_sigma_rad,
        )
        drives, trials = [], []
        for log in range(self.logs):
            if progress:
                progress("estimating", log / self.logs)
            rng = np.random.default_rng([seed, log])
            drives.append(
                drive(self.length_m, self.step_m, self.landmarks, self.reach_m, noise, rng)
            )
            trials.append(estimated(drives[-1]))
        return results(drives, trials, self.step_m)
