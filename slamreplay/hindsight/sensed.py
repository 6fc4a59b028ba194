"""What keyframes saw beside the scans, as constraints of the pose graph: tags, docks, fixes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2
from slamreplay.geometry.alignment import aligned
from slamreplay.graph import sightings as graph

#: Sightings of one thing by neighbouring keyframes share the camera's and the tag's own errors, and
#: fixes of one receiver those of the sky: each is given that much more variance.
SAME_THING, SAME_SKY = 3.0, 10.0
#: Sightings under one name farther apart than this are of two things.
ONE_THING_M = 2.0
#: Fixes tell of a frame if the way is this many times longer than they err.
_WORTH = 2.0


@dataclass(frozen=True, eq=False)
class Sensed:
    """M sightings and F fixes, each seen from a keyframe.

    Attributes:
        key: (M,) the keyframe.
        name: (M,) index into `names`.
        xyyaw: (M, 3) the thing seen from the keyframe; its heading is NaN where it is not sensed.
        cov: (M, 3, 3) in axes of the keyframe.
        names: the things' names, their kind first.
        surveyed: (L, 3) poses in the working frame of the things that are surveyed, else NaN.
        fix_key: (F,) the keyframe of a fix.
        fix_xyyaw: (F, 3) the antenna seen from the keyframe; its heading is the base's then.
        fix_xy: (F, 2) the antenna in the fixes' frame.
        fix_cov: (F, 2, 2) in axes of the fixes' frame.
    """

    key: NDArray[np.int64]
    name: NDArray[np.int64]
    xyyaw: se2.Array
    cov: se2.Array
    names: tuple[str, ...]
    surveyed: se2.Array
    fix_key: NDArray[np.int64]
    fix_xyyaw: se2.Array
    fix_xy: se2.Array
    fix_cov: se2.Array

    def joined(self) -> Mapping[str, int]:
        """How many measurements of each kind join the pose graph."""
        kinds = [self.names[j].split(" ")[0] for j in self.name]
        counts = {kind: kinds.count(kind) for kind in sorted(set(kinds))}
        return {**counts, "gnss": len(self.fix_key)} if len(self.fix_key) else counts

    def constraints(self, poses: se2.Array) -> tuple[graph.Sightings | None, graph.Fixes | None]:
        """What joins the pose graph where the keyframes are at about these poses (K, 3)."""
        return self._landmarks(poses), self._fixes(poses)

    def _landmarks(self, poses: se2.Array) -> graph.Sightings | None:
        placed = se2.compose(poses[self.key], self.xyyaw)
        landmark = np.full(len(self.key), -1, dtype=np.int64)
        initial: list[se2.Array] = []
        known: list[bool] = []
        for j in range(len(self.names)):
            rows = np.flatnonzero(self.name == j)
            is_known = bool(np.isfinite(self.surveyed[j, :2]).all())
            parts = [rows] if is_known else _apart(placed[rows], rows)
            for part in parts:
                # Seen from one place only, a thing that nobody surveyed says nothing.
                if len(np.unique(self.key[part])) < 2 and not is_known:
                    continue
                landmark[part] = len(initial)
                middle = part[np.argmin(_distances(placed[part]).sum(axis=1))]
                initial.append(self.surveyed[j] if is_known else placed[middle])
                known.append(is_known)
        use = np.flatnonzero(landmark >= 0)
        if not len(use):
            return None
        return graph.Sightings(
            self.key[use],
            landmark[use],
            self.xyyaw[use],
            SAME_THING * self.cov[use],
            np.array(initial),
            np.array(known),
        )

    def _fixes(self, poses: se2.Array) -> graph.Fixes | None:
        if len(self.fix_key) < 3:
            return None
        antenna = se2.compose(poses[self.fix_key], self.fix_xyyaw)
        spread = np.sqrt(np.linalg.eigvalsh(np.cov(self.fix_xy.T))[-1])
        if spread < _WORTH * np.sqrt(np.median(self.fix_cov[:, 0, 0] + self.fix_cov[:, 1, 1])):
            return None
        frame = aligned(self.fix_xy, antenna[:, :2])
        seen = np.column_stack([self.fix_xy, se2.wrap_angle(antenna[:, 2] - frame[2])])
        at_key = se2.compose(seen, se2.inverse(self.fix_xyyaw))
        return graph.Fixes(self.fix_key, at_key, SAME_SKY * self.fix_cov, frame)


def _apart(placed: se2.Array, rows: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Rows in groups that are connected by steps under `ONE_THING_M`, each thing a group."""
    from scipy.sparse.csgraph import connected_components

    count, label = connected_components(_distances(placed) < ONE_THING_M, directed=False)
    return [rows[label == i] for i in range(count)]


def _distances(placed: se2.Array) -> se2.Array:
    return np.asarray(np.hypot(*(placed[:, None, :2] - placed[None, :, :2]).transpose(2, 0, 1)))
