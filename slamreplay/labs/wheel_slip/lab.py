"""What a recipe sets of the slip, and the bags that answer it."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from slamreplay.labs.lab import Lab, LabResults, Progress
from slamreplay.labs.wheel_slip.drive import round_trip
from slamreplay.labs.wheel_slip.pages import Pair, results
from slamreplay.labs.wheel_slip.trials import ESTIMATED, course_of, slip_of
from slamreplay.simulate.bundled import bundle_of
from slamreplay.simulate.drive import Slip


class WheelSlip(Lab):
    """Covariances through a wheel slip in recorded bags, beside the same drives without it."""

    slip_from_m: Annotated[float, Field(ge=1.0, le=40.0)]
    slip_s: Annotated[float, Field(ge=0.1, le=60.0)]
    grip: Annotated[float, Field(ge=0.0, lt=1.0)]
    turn_rad_s: Annotated[float, Field(ge=-1.0, le=1.0)]
    logs: Annotated[int, Field(ge=1, le=200)]

    def run(self, seed: int, progress: Progress | None = None) -> LabResults:
        """Record each drive with and without the slip, and run every estimator on both bags."""
        slip = Slip(self.slip_from_m, self.slip_s, self.grip, self.turn_rad_s)
        pairs: dict[str, list[Pair]] = {name: [] for name in ESTIMATED}
        for log in range(self.logs):
            if progress:
                progress("slipping", log / self.logs)
            slipped, steady = (round_trip(given, seed + log) for given in (slip, None))
            views = [bundle_of(made, suffix=".bag").view() for made in (slipped, steady)]
            for name in ESTIMATED:
                courses = [
                    course_of(name, view, made, seed + log)
                    for view, made in zip(views, (slipped, steady), strict=True)
                ]
                pairs[name].append(Pair(*courses))
        return results(pairs, slip_of(slipped), slipped.motion.xyyaw, slipped.motion.t_s)
