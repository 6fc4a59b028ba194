"""Which cloud topics a log has, whether they are needed, and which of several is flattened."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.ingest.clouds import CLOUD_TYPES
from slamreplay.ingest.clouds.fields import Clouds
from slamreplay.ingest.names import basename, is_map_frame, is_odom_frame, tokens
from slamreplay.ingest.readers.reader import Connection

#: Words of clouds that somebody made of others: parts of them, or maps put together of many.
_MADE = frozenset({"map", "global", "registered", "aligned", "accumulated", "ground", "nonground",
                   "clusters", "cluster", "obstacles", "obstacle", "markers", "features", "edge",
                   "surf", "corner", "keyframe", "voxel", "costmap", "path"})  # fmt: skip
_BEARINGS = 360


@dataclass(frozen=True)
class CloudTopics:
    """The cloud topics of a log.

    Attributes:
        names: all of them.
        later: those that the first pass leaves out: all but what the user wants kept as points.
        forced: the one that the user gave the role `scan`, None where nobody did.
    """

    names: frozenset[str]
    later: frozenset[str]
    forced: str | None


def cloud_topics(
    connections: Sequence[Connection],
    overrides: Mapping[str, str],
    skip: Callable[[str], str | None],
) -> CloudTopics:
    """The cloud topics of a log."""
    names = {c.topic for c in connections if c.type in CLOUD_TYPES and skip(c.topic) is None}
    forced = overrides.get("scan")
    later = names - {overrides.get("points")}
    return CloudTopics(frozenset(names), frozenset(later), forced if forced in names else None)


def best_cloud(found: Mapping[str, Clouds], view: BundleView) -> tuple[str, str] | None:
    """The topic to flatten and why, None where none will do.

    The widest view goes before the densest: a place is known by what stands all around it.

    Args:
        found: topic to its first clouds.
        view: the log's transforms and frames.
    """
    usable = {t: c for t, c in found.items() if len(c) and not _is_map(c)}
    if not usable:
        return None

    def rank(topic: str) -> tuple[object, ...]:
        clouds = usable[topic]
        width, points = width_deg(clouds, view), points_per_cloud(clouds)
        made = bool(_MADE & set(tokens(topic)))
        on_tf = view.manifest.frames.base is None or _is_on_tf(clouds, view)
        return (not made, on_tf, round(width / 30.0), points, -len(tokens(topic)))

    chosen = max(usable, key=lambda t: (rank(t), t))
    if len(found) == 1:
        return chosen, "the only cloud"
    width, points = width_deg(usable[chosen], view), points_per_cloud(usable[chosen])
    return chosen, f"the best of {len(found)} clouds: {width:.0f} deg wide, {points:.0f} points"


def width_deg(clouds: Clouds, view: BundleView) -> float:
    """Bearings in which a cloud has points, degrees: the median of all clouds."""
    xyz = clouds.xyz
    base, frame = view.manifest.frames.base, str(clouds.frame_id[0])
    if base is not None and _is_on_tf(clouds, view):
        T, valid = view.transforms.lookup(base, frame, np.zeros(1, dtype=np.int64))
        if valid[0]:
            xyz = (T[0, :3, :3] @ xyz).astype(np.float32)
    elif "optical" in tokens(basename(frame)):
        xyz = xyz[[2, 0, 1]]
    seen = np.isfinite(xyz[0])
    bearing = np.degrees(np.arctan2(xyz[1, seen], xyz[0, seen])).astype(np.int64) % _BEARINGS
    cells = np.unique(clouds.owner[seen] * _BEARINGS + bearing) // _BEARINGS
    return float(np.median(np.bincount(cells, minlength=len(clouds))))


def points_per_cloud(clouds: Clouds) -> float:
    """Points with a return: the median of all clouds."""
    seen = clouds.owner[np.isfinite(clouds.xyz[0])]
    return float(np.median(np.bincount(seen, minlength=len(clouds))))


def _is_map(clouds: Clouds) -> bool:
    return any(is_map_frame(f) or is_odom_frame(f) for f in set(clouds.frame_id))


def _is_on_tf(clouds: Clouds, view: BundleView) -> bool:
    base, frame = view.manifest.frames.base, str(clouds.frame_id[0])
    return base is not None and (frame == base or view.transforms.has_path(base, frame))
