"""Hindsight of a log whose maps were of several places: that of each stretch, put together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.met import BeamsMet, padded
from slamreplay.bundle.products import Changes, Hindsight, Part
from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2


def nowhere(frame_id: str, base: str, t_ns: NDArray[np.int64]) -> Hindsight:
    """Hindsight that does not know where the robot was at any scan (N,)."""
    n = len(t_ns)
    track = PoseTrack.without_covariance(frame_id, base, t_ns, np.full((n, 3), np.nan))
    return Hindsight(track, float("nan"), 0.0, np.full(n, np.nan), None, None)


def joined(parts: Sequence[Part], frame_id: str, shape: tuple[int, ...]) -> Hindsight:
    """One trajectory of all stretches, in the order of time; changed cells are the last map's.

    Between two stretches the trajectory jumps, for so do the maps. Of margins the least one is
    told.

    Args:
        parts: one stretch or more.
        frame_id: the map frame.
        shape: rows and columns of the last map.
    """
    found = [part.hindsight for part in parts]
    tracks = [h.track for h in found]
    track = PoseTrack(
        frame_id,
        tracks[-1].child_frame_id,
        *(np.concatenate([getattr(t, name) for t in tracks]) for name in ("t_ns", "xyyaw", "cov")),
    )
    has_pose = track.has_pose
    sigma = np.sqrt(0.5 * (track.cov[:, 0, 0] + track.cov[:, 1, 1]))
    margins = [h.margin for h in found if h.margin is not None]
    kinds = sorted({kind for h in found for kind in h.joined})
    return Hindsight(
        track,
        float(np.median(sigma[has_pose])) if has_pose.any() else float("nan"),
        float(has_pose.mean()) if len(track) else 0.0,
        np.concatenate([h.match for h in found]),
        min(margins, default=None),
        _changes(parts, shape),
        {kind: sum(h.joined.get(kind, 0) for h in found) for kind in kinds},
        np.concatenate([_lead(h) for h in found]),
        parts=tuple(parts),
    )


def _lead(found: Hindsight) -> se2.Array:
    return found.lead if len(found.lead) else np.full(len(found.track), np.inf)


def _changes(parts: Sequence[Part], shape: tuple[int, ...]) -> Changes | None:
    """Shares of all stretches, regions with the map they are drawn in, cells of the last map."""
    if all(part.hindsight.changes is None for part in parts):
        return None
    last = parts[-1].hindsight.changes
    if last is None:
        none, no_share = np.zeros(shape, dtype=bool), np.zeros(0)
        last = Changes(none, none, (), np.zeros(0, np.int64), no_share, no_share, no_share)
    every = [_shares(part.hindsight) for part in parts]
    t_ns, *shares = (np.concatenate(columns) for columns in zip(*every, strict=True))
    regions = [
        replace(region, map_version=part.stretch.version)
        for part in parts[:-1]
        if part.hindsight.changes is not None
        for region in part.hindsight.changes.regions
    ]
    return replace(
        last,
        regions=(*last.regions, *regions),
        t_ns=t_ns,
        changed_share=shares[0],
        appeared_share=shares[1],
        removed_share=shares[2],
        met=_met(parts),
    )


def _met(parts: Sequence[Part]) -> tuple[BeamsMet, ...]:
    """Classes of the beams of all stretches, by laser; a stretch may know of fewer lasers."""
    every = [part.hindsight.changes.met for part in parts if part.hindsight.changes is not None]
    found = []
    for k in range(max(map(len, every), default=0)):
        those = [met[k] for met in every if k < len(met)]
        width = max(one.met.shape[1] for one in those)
        t_ns = np.concatenate([one.t_ns for one in those])
        found.append(BeamsMet(t_ns, np.concatenate([padded(one.met, width) for one in those])))
    return tuple(found)


def _shares(found: Hindsight) -> tuple[NDArray, ...]:
    changes = found.changes
    if changes is None:
        unknown = np.full(len(found.track), np.nan)
        return found.track.t_ns, unknown, unknown, unknown
    return changes.t_ns, changes.changed_share, changes.appeared_share, changes.removed_share
