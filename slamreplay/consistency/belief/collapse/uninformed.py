"""Where a covariance shrank although nothing could have told the localizer anything."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.consistency.belief.collapse.size import mean_sigma, position_sigma
from slamreplay.consistency.belief.collapse.stretch import Stretch
from slamreplay.consistency.context import CheckContext
from slamreplay.geometry.times import NS_PER_S

#: A sigma that is smaller by this factor shrank; the spread of particles flickers by less.
SHRUNK = 1.25
#: Nothing was sensed: for so long and so many usual intervals, after what is still being worked on.
SILENT_NS, SILENT_PERIODS, DELAY_NS = 2 * NS_PER_S, 10, NS_PER_S


def uninformed(context: CheckContext) -> list[Stretch]:
    """Stretches in which sigma shrank by a quarter of what it became, without information.

    Of a run: rows that took no measurement in, as its diagnostics (`updated`) and innovations
    (`accepted`) say. Of the robot's own localizer: times without a scan, sighting, fix or initial
    pose in the log, from a second after the last one. A log without scans says nothing of these.
    """
    if context.subject:
        return _of_run(context)
    updates = context.updates
    return [] if updates is None else _of_robot(updates, context.view)


def _of_robot(updates: PoseTrack, view: BundleView) -> list[Stretch]:
    scans = view.table("scans").t_ns
    if len(scans) < SILENT_PERIODS:
        return []
    others = [view.table(name).t_ns for name in ("references", "initial_poses")]
    told = np.unique(np.concatenate([scans, *others]))
    silent = max(SILENT_NS, SILENT_PERIODS * int(np.median(np.diff(np.unique(scans)))))
    until = np.append(told[1:], max(int(told[-1]), int(updates.t_ns[-1]) + 1))
    found = []
    for gap in np.flatnonzero(until - told > silent).tolist():
        inside = (updates.t_ns > told[gap] + DELAY_NS) & (updates.t_ns < until[gap])
        text = "although no scan, sighting or fix is in the log in that time"
        found += _shrinking(updates, np.flatnonzero(inside), text)
    return found


def _of_run(context: CheckContext) -> list[Stretch]:
    track = context.belief
    if track is None or not ("updated" in context.diagnostics or context.innovations):
        return []
    informed = np.nan_to_num(context.diagnostics.get("updated", np.zeros(len(track)))) > 0.0
    accepted = [i.t_ns[i.accepted] for i in context.innovations]
    told = np.sort(np.concatenate([*accepted, context.view.table("initial_poses").t_ns]))
    upto = np.searchsorted(told, track.t_ns, side="right")
    informed[1:] |= np.diff(upto) > 0
    informed |= ~np.isfinite(track.cov[:, :2, :2]).all(axis=(1, 2))
    stretch = np.cumsum(informed)  # a row that was informed, and those after it that were not
    found = []
    for number in np.flatnonzero(np.bincount(stretch) > 1).tolist():
        text = "although no measurement was taken in"
        found += _shrinking(track, np.flatnonzero(stretch == number), text)
    return found


def _shrinking(track: PoseTrack, rows: NDArray[np.int64], text: str) -> list[Stretch]:
    """The stretch from the largest sigma in these rows down to the smallest after it, if any."""
    size = mean_sigma(track.cov[rows])
    if len(size) < 2 or not np.isfinite(size).all():
        return []
    before = np.maximum.accumulate(size)
    with np.errstate(divide="ignore", invalid="ignore"):
        shrunk = np.where(before > 0.0, before / size, 1.0)
    last = int(np.argmax(shrunk))
    if shrunk[last] < SHRUNK:
        return []
    first = int(np.flatnonzero(size[: last + 1] == before[last])[-1])
    start, end = int(track.t_ns[rows[first]]), int(track.t_ns[rows[last]])
    was, became = position_sigma(track.cov[rows[[first, last]]])
    factor = f"by a factor of {shrunk[last]:.2g}" if size[last] > 0.0 else "to nothing"
    words = f"sigma shrank {factor} (the position's from {was:.2g} to {became:.2g} m) {text}"
    return [Stretch(start, end, {"uninformed": words}, last - first + 1, float(shrunk[last]))]
