"""What the mean of a NEES series says, in a sentence that a user can act on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from slamreplay.consistency.statistics.mean_test import NOMINAL, MeanTest

Credibility = Literal["consistent", "overconfident", "underconfident", "insufficient"]


@dataclass(frozen=True)
class NeesSummary:
    """The mean of the NEES of one part of a pose.

    Attributes:
        what: the part in words ("the position").
        test: the mean against its 95 % interval.
        at_most: whether the covariance that was claimed is only a bound of what the errors can
            have: then sigma may be found too small, by the factor at least, and never too large.
    """

    what: str
    test: MeanTest
    at_most: bool = False

    @property
    def credibility(self) -> Credibility:
        """Where the mean lies; outside of the interval one sound log in twenty does."""
        test = self.test
        if test.mean is None or test.p_value is None or not test.sufficient:
            return "insufficient"
        if self.at_most and test.p_small is not None:
            return "overconfident" if test.p_small < NOMINAL else "consistent"
        if test.p_value >= NOMINAL:
            return "consistent"
        return "overconfident" if test.mean > test.dof else "underconfident"

    @property
    def sentence(self) -> str:
        """The factor by which sigma is wrong, and the numbers behind it."""
        test = self.test
        if test.mean is None or test.ratio is None or test.low is None or test.high is None:
            return f"the sigma of {self.what} could not be judged: no row was valid"
        too = "small" if test.ratio >= 1.0 or self.at_most else "large"
        factor = test.ratio if too == "small" else 1.0 / max(test.ratio, 1e-9)
        least = "at least " if self.at_most else ""
        text = f"the sigma of {self.what} is too {too} by a factor of {least}{factor:.2g}"
        if self.credibility == "consistent":
            fits = "is not shown to be too small for" if self.at_most else "fits"
            text = f"the sigma of {self.what} {fits} its error (factor {test.ratio:.2g})"
        if self.credibility == "insufficient":
            text = f"undecided whether {text}"
            if self.at_most and test.ratio < 1.0:
                text = f"undecided whether the sigma of {self.what} is too small"
        return (
            f"{text}: mean NEES {test.mean:.3g} where {test.dof} is expected, 95 % of consistent "
            f"ones within {test.low:.3g} to {test.high:.3g}; {test.n} updates are worth "
            f"{test.n_eff:.0f} independent ones"
        )
