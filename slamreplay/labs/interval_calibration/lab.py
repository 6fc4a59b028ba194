"""What a recipe sets of the logs that are judged, and the counting."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from slamreplay.labs.interval_calibration.pages import results
from slamreplay.labs.interval_calibration.trials import (
    HARDER,
    Cell,
    autoregressive,
    harder,
    rows_for,
)
from slamreplay.labs.lab import Lab, LabResults, Progress, Strict

#: Rows of all logs together: more would take an hour.
MOST_ROWS = 500_000_000
Ratio = Annotated[float, Field(ge=1.0, le=10.0)]


class Power(Strict):
    """How often a sigma that is told too small is found."""

    dof: Annotated[int, Field(ge=1, le=6)]
    rho: Annotated[float, Field(ge=0.0, le=0.99)]
    sigma_too_small_by: Annotated[list[Ratio], Field(min_length=1, max_length=20)]


class IntervalCalibration(Lab):
    """Consistent logs that the 95 % interval of mean NEES misses, and lies that it finds."""

    dof: Annotated[list[Annotated[int, Field(ge=1, le=6)]], Field(min_length=1, max_length=6)]
    rho: Annotated[
        list[Annotated[float, Field(ge=0.0, le=0.99)]], Field(min_length=1, max_length=10)
    ]
    n_eff: Annotated[list[Annotated[int, Field(ge=5, le=2000)]], Field(min_length=1, max_length=10)]
    power: Power
    harder_rows: Annotated[list[Annotated[int, Field(ge=20, le=20_000)]], Field(max_length=5)]
    logs: Annotated[int, Field(ge=2, le=100_000)]

    @model_validator(mode="after")
    def _fits(self) -> IntervalCalibration:
        rows = sum(rows_for(n, rho) for n in self.n_eff for rho in self.rho) * len(self.dof)
        ratios = len(self.power.sigma_too_small_by)
        rows += sum(rows_for(n, self.power.rho) for n in self.n_eff) * ratios
        rows += sum(self.harder_rows) * len(HARDER)
        if rows * self.logs > MOST_ROWS:
            raise ValueError(f"rows of all logs together should be at most {MOST_ROWS}")
        return self

    def run(self, seed: int, progress: Progress | None = None) -> LabResults:
        """Count false alarms of consistent logs, what is found of lies, then harder memories."""
        alarms = [(dof, n, rho) for dof in self.dof for n in self.n_eff for rho in self.rho]
        lies = [(n, ratio) for n in self.n_eff for ratio in self.power.sigma_too_small_by]
        hard = [(name, rows) for name in HARDER for rows in self.harder_rows]
        whole, done = len(alarms) + len(lies) + len(hard), 0

        def drawn() -> np.random.Generator:
            nonlocal done
            if progress:
                progress("counting", done / whole)
            done += 1
            return np.random.default_rng([seed, done])

        false: list[Cell] = []
        for dof, n, rho in alarms:
            false.append(autoregressive(dof, n, rho, 1.0, self.logs, drawn()))
        power, found = self.power, []
        for n, ratio in lies:
            found.append(autoregressive(power.dof, n, power.rho, ratio, self.logs, drawn()))
        harder_cells = [harder(name, rows, self.logs, drawn()) for name, rows in hard]
        return results(false, found, harder_cells)
