"""What holds for a covariance of AMCL, which tells little else about itself."""

from __future__ import annotations

import numpy as np

from slamreplay.consistency.belief.validity import published_rows
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.evidence.published import published_belief

#: What nav2_amcl fills of the 36 entries: xx, xy, yx, yy, and yaw-yaw.
_FILLED = (0, 1, 6, 7, 35)


def is_amcl(context: CheckContext) -> bool:
    """Whether the belief is AMCL's: by what its covariances have, or by its name."""
    if context.subject:
        return context.subject == "amcl"
    rows = published_rows(context.view)
    if rows is None or not len(rows):
        return False
    filled = np.flatnonzero((np.nan_to_num(rows["covariance"]) != 0.0).any(axis=0))
    return tuple(filled.tolist()) == _FILLED or "amcl" in str(rows["topic"][0]).lower()


def amcl_limits(context: CheckContext) -> str:
    """A clause on what can be judged of a particle filter; empty for any other localizer.

    It publishes on updates only, and couples no heading: its parts are judged apart, for the joint
    value would be an approximation.
    """
    if not context.subject and published_belief(context.view) is None and context.updates:
        return "no covariance was published: these are the mean and covariance of its particles"
    if not is_amcl(context):
        return ""
    text = "AMCL's position and heading are judged apart, on its updates"
    if context.belonging is None or not context.belonging.seen.any():
        text += "; without its particles in the log clusters go unseen"
    return text
