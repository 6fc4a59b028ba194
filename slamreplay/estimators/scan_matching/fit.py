"""How a scan came to its pose."""

from __future__ import annotations

from dataclasses import dataclass

from slamreplay.geometry import se2


@dataclass(frozen=True, eq=False)
class Fit:
    """How a scan came to its pose: rows of the ledger.

    Attributes:
        pose: (3,).
        residual: (3,) match minus prediction; NaN where nothing was matched.
        S: (3, 3) its covariance.
        score: 0 to 1; NaN where nothing was matched.
        accepted: whether the match was used.
        moved: (3,) pose minus prediction.
    """

    pose: se2.Array
    residual: se2.Array
    S: se2.Array
    score: float
    accepted: bool
    moved: se2.Array

    @property
    def is_matched(self) -> bool:
        """Whether there was enough to match."""
        return self.score == self.score
