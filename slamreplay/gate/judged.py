"""Which moments of a log the verdict judged, and why it judged none."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.evidence.result import Postmortem
from slamreplay.verdict.belief_error import judgeable
from slamreplay.verdict.judgement import UNDECIDED


def judged_moments(post: Postmortem, t_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(N,) of the times (N,) that lie in a judged interval, at a scan that hindsight can explain.

    As the verdict has it: a pose with a small enough sigma, and a scan that the map does not
    explain far worse than the log's typical one. A time between two scans is the earlier's.
    """
    hindsight = post.hindsight
    if hindsight is None or not len(hindsight.track):
        return np.zeros(len(t_ns), dtype=bool)
    inside = np.zeros(len(t_ns), dtype=bool)
    for interval in post.judgement.intervals:
        if interval.state not in UNDECIDED:
            # The last one holds its end as well: a log's last scan may be its last moment.
            inside |= (t_ns >= interval.start_ns) & (t_ns <= interval.end_ns)
    for interval in post.judgement.intervals:
        if interval.state in UNDECIDED:
            inside &= ~((t_ns >= interval.start_ns) & (t_ns < interval.end_ns))
    order = np.argsort(hindsight.track.t_ns, kind="stable")
    row = np.searchsorted(hindsight.track.t_ns[order], t_ns, side="right") - 1
    explained = judgeable(hindsight, post.limits)[order]
    return np.asarray(inside & explained[np.maximum(row, 0)])


def why_unjudged(post: Postmortem, otherwise: str) -> str:
    """Why belief and map could not be judged, the gravest lack first.

    Args:
        post: the post-mortem.
        otherwise: where it has all that it takes.
    """
    if post.grid is None:
        return "no map"
    if post.hindsight is None:
        return "no scans"
    if post.belief is None or not post.belief.has_pose.any():
        return "no localizer spoke"
    if post.judgement.state in UNDECIDED:
        return post.judgement.summary.rstrip(".")
    return otherwise
