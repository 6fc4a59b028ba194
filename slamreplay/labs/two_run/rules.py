"""When a belief is tight, when it is right, and when it is credible."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from slamreplay.labs.lab import Strict


class Rules(Strict):
    """Thresholds, all a recipe's to set.

    Attributes:
        tight_to_sigma_m: standard deviation of the position along the widest axis, up to which
            (and with one cluster of particles) a belief is tight: all that the robot can know.
        right_to_m: distance from the truth up to which, and
        right_to_deg: difference in heading up to which a belief is right.
        credible_for_s: a belief is credible from when it is tight and right for that long on.
    """

    tight_to_sigma_m: Annotated[float, Field(gt=0.0, le=100.0)]
    right_to_m: Annotated[float, Field(gt=0.0, le=100.0)]
    right_to_deg: Annotated[float, Field(gt=0.0, le=180.0)]
    credible_for_s: Annotated[float, Field(ge=0.0, le=1000.0)]
