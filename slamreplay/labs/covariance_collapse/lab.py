"""What a recipe sets of wheels, noise and references, and the logs that answer it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from slamreplay.labs.covariance_collapse.drive import drive, log_of
from slamreplay.labs.covariance_collapse.pages import results
from slamreplay.labs.covariance_collapse.trials import Claim, claim_of
from slamreplay.labs.lab import Lab, LabResults, Progress
from slamreplay.simulate.sensors import WheelErrors


class CovarianceCollapse(Lab):
    """Process noise told too low: what the covariance claims, what is true, and who finds it."""

    estimators: Annotated[list[Literal["dead_reckoning", "ekf"]], Field(min_length=1, max_length=2)]
    process_noise_scale: Annotated[
        list[Annotated[float, Field(ge=1e-6, le=1.0)]], Field(min_length=1, max_length=12)
    ]
    reference_every_s: Annotated[
        list[Annotated[float, Field(gt=0.0, le=600.0)] | None], Field(min_length=1, max_length=6)
    ]
    wheel_scale: Annotated[float, Field(ge=-0.2, le=0.2)]
    wheel_turn_scale: Annotated[float, Field(ge=-0.2, le=0.2)]
    wheel_pull_rad_per_m: Annotated[float, Field(ge=-0.05, le=0.05)]
    logs: Annotated[int, Field(ge=1, le=100)]

    @model_validator(mode="after")
    def _told_apart(self) -> CovarianceCollapse:
        for name in ("estimators", "process_noise_scale", "reference_every_s"):
            given = getattr(self, name)
            if len(set(given)) != len(given):
                raise ValueError(f"{name} names one twice")
        return self

    def run(self, seed: int, progress: Progress | None = None) -> LabResults:
        """Drive the logs, and run every estimator on each with every process noise."""
        wheels = WheelErrors(self.wheel_scale, self.wheel_turn_scale, self.wheel_pull_rad_per_m)
        claims: dict[tuple[str, float], list[Claim]] = {}
        for log in range(seed, seed + self.logs):
            if progress:
                progress("collapsing", (log - seed) / self.logs)
            recording = drive(wheels, log)
            bundle = log_of(recording)
            for name in self.estimators:
                for scale in self.process_noise_scale:
                    claim = claim_of(name, scale, bundle, recording, self.reference_every_s, log)
                    claims.setdefault((name, scale), []).append(claim)
        return results(claims, self.reference_every_s)
