"""The offline tf buffer: who is whose parent, and where a frame was at a time.

It interpolates between samples and never extrapolates in silence: a time outside the samples of a
dynamic edge is masked as invalid. Either parent order of map and odom is walked.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.errors import TransformError
from slamreplay.geometry import se3
from slamreplay.geometry.se2 import Array
from slamreplay.geometry.times import Times


def clean_frame(name: str) -> str:
    """A frame name as tf2 has it: without the leading slash of ROS 1."""
    return name.strip().lstrip("/")


@dataclass(frozen=True, eq=False)
class Edge:
    """Samples of one parent -> child transform, sorted by time.

    Attributes:
        parent: parent frame.
        child: child frame.
        t_ns: (N,) times, strictly increasing; a static edge has one sample that holds always.
        translation_xyz: (N, 3) m, of the child's origin in the parent.
        rotation_xyzw: (N, 4) unit quaternions.
        is_static: whether the single sample holds at all times.
    """

    parent: str
    child: str
    t_ns: Times
    translation_xyz: Array
    rotation_xyzw: Array
    is_static: bool

    def at(self, t_ns: Times) -> tuple[Array, NDArray[np.bool_]]:
        """T_parent_child (M, 4, 4) at times (M,), and the mask of those inside the samples."""
        if self.is_static:
            T = se3.matrix(self.translation_xyz[-1], self.rotation_xyzw[-1])
            return np.broadcast_to(T, (len(t_ns), 4, 4)).copy(), np.ones(len(t_ns), dtype=bool)
        low = np.clip(np.searchsorted(self.t_ns, t_ns, side="right") - 1, 0, len(self.t_ns) - 1)
        high = np.minimum(low + 1, len(self.t_ns) - 1)
        span = np.maximum(self.t_ns[high] - self.t_ns[low], 1)
        part = np.clip((t_ns - self.t_ns[low]) / span, 0.0, 1.0)[:, None]
        translation = (1 - part) * self.translation_xyz[low] + part * self.translation_xyz[high]
        a, b = self.rotation_xyzw[low], self.rotation_xyzw[high]
        b = np.where(np.sum(a * b, axis=1, keepdims=True) < 0.0, -b, b)
        # Normalised linear interpolation: between samples of a robot's tf (some degrees apart at
        # the most) it differs from the great arc by less than 1e-5 rad.
        T = se3.matrix(translation, (1 - part) * a + part * b)
        return T, (t_ns >= self.t_ns[0]) & (t_ns <= self.t_ns[-1])


class TransformBuffer:
    """A tree of edges that answers T_target_source at many times at once.

    Args:
        edges: at most one edge for each child frame (two parents are settled at ingest).

    Raises:
        TransformError: a child with two parents, or a cycle.
    """

    def __init__(self, edges: Iterable[Edge]) -> None:
        self._by_child: dict[str, Edge] = {}
        for edge in edges:
            if edge.child in self._by_child:
                parents = f"'{self._by_child[edge.child].parent}' and '{edge.parent}'"
                raise TransformError(f"frame has two parents: {parents}", where=edge.child)
            self._by_child[edge.child] = edge
        for child in self._by_child:
            self._ancestry(child)

    @property
    def edges(self) -> Mapping[str, Edge]:
        """Every edge by its child frame."""
        return self._by_child

    def frames(self) -> list[str]:
        """All frame names, sorted."""
        return sorted({*self._by_child, *(e.parent for e in self._by_child.values())})

    def has_path(self, target: str, source: str) -> bool:
        """Whether the two frames hang in one tree."""
        known = self.frames()
        if target not in known or source not in known:
            return target == source
        return self._ancestry(target)[-1] == self._ancestry(source)[-1]

    def lookup(self, target: str, source: str, t_ns: Times) -> tuple[Array, NDArray[np.bool_]]:
        """T_target_source (M, 4, 4) at times (M,) and the mask of times covered by every edge.

        Raises:
            TransformError: the frames are not connected.
        """
        t_ns = np.asarray(t_ns, dtype=np.int64)
        if not self.has_path(target, source):
            raise TransformError(
                f"no transform between '{target}' and '{source}'",
                hint=f"tf knows: {', '.join(self.frames()) or 'nothing'}",
            )
        up_target, up_source = self._ancestry(target), self._ancestry(source)
        common = next(frame for frame in up_source if frame in up_target)
        T_common_source, valid_source = self._chain(up_source, common, t_ns)
        T_common_target, valid_target = self._chain(up_target, common, t_ns)
        return se3.inverse(T_common_target) @ T_common_source, valid_source & valid_target

    def fixed(self, target: str, source: str) -> Array | None:
        """T_target_source (4, 4) where only static edges lie between them; None where not."""
        if target == source:
            return np.eye(4)
        if not self.has_path(target, source):
            return None
        if not all(edge.is_static for edge in self.path(target, source)):
            return None
        return self.lookup(target, source, np.zeros(1, dtype=np.int64))[0][0]

    def path(self, target: str, source: str) -> list[Edge]:
        """The edges between two connected frames, in no particular direction."""
        up_target, up_source = self._ancestry(target), self._ancestry(source)
        common = next(frame for frame in up_source if frame in up_target)
        below = [*up_source[: up_source.index(common)], *up_target[: up_target.index(common)]]
        return [self._by_child[frame] for frame in below]

    def _chain(self, ancestry: list[str], top: str, t_ns: Times) -> tuple[Array, NDArray[np.bool_]]:
        T = np.broadcast_to(np.eye(4), (len(t_ns), 4, 4)).copy()
        valid = np.ones(len(t_ns), dtype=bool)
        for frame in ancestry[: ancestry.index(top)]:
            step, covered = self._by_child[frame].at(t_ns)
            T, valid = step @ T, valid & covered
        return T, valid

    def _ancestry(self, frame: str) -> list[str]:
        line = [frame]
        while line[-1] in self._by_child:
            parent = self._by_child[line[-1]].parent
            if parent in line:
                raise TransformError(f"cycle in tf: {' -> '.join([*line, parent])}", where=frame)
            line.append(parent)
        return line
