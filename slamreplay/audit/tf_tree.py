"""Whether tf is one tree: second parents, cycles, edges told twice, frames that hang nowhere."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from slamreplay.audit.streams import Stream
from slamreplay.bundle.manifest import LEADING_SLASH, Manifest
from slamreplay.bundle.tables import Table
from slamreplay.geometry.se2 import Array
from slamreplay.geometry.transforms import TransformBuffer, clean_frame

#: Two tellings of one fixed place that differ by less are the same: m, and rad at a metre.
SAME = 1e-3

Kind = Literal["second parent", "cycle", "static and moving", "several values", "leading slash"]


@dataclass(frozen=True)
class TreeFault:
    """Something about tf that a tree does not have.

    Attributes:
        kind: what it is.
        what: the edge, or the topic.
        samples: rows it concerns.
        apart: how far the tellings differ at the most, in m plus rad at one metre; None where that
            is no question.
        text: what was made of it.
    """

    kind: Kind
    what: str
    samples: int
    apart: float | None
    text: str


def tree_faults(manifest: Manifest, transforms: Table, edges: Sequence[Stream]) -> list[TreeFault]:
    """What is wrong with the tree, the gravest kinds first.

    Args:
        manifest: knows what was left out when the tree was settled.
        transforms: the rows.
        edges: their streams.
    """
    found = [
        TreeFault(left.fault, f"{left.parent} -> {left.child}", left.samples, None, left.reason)
        for left in manifest.frames.left_out
    ]
    by_edge: dict[tuple[str, str], list[Stream]] = {}
    for stream in edges:
        if stream.edge is not None:
            by_edge.setdefault(stream.edge, []).append(stream)
    for edge, tellings in sorted(by_edge.items()):
        found += _told_twice(edge, tellings, transforms)
    slashes = [loss for loss in manifest.losses if loss.reason == LEADING_SLASH]
    found += [
        TreeFault("leading slash", s.what, s.count, None, "tf2 refuses such names") for s in slashes
    ]
    order = ("second parent", "cycle", "static and moving", "several values", "leading slash")
    return sorted(found, key=lambda f: (order.index(f.kind), f.what))


def _told_twice(
    edge: tuple[str, str], tellings: Sequence[Stream], transforms: Table
) -> list[TreeFault]:
    static = [s for s in tellings if s.topic.endswith("tf_static")]
    moving = [s for s in tellings if not s.topic.endswith("tf_static")]
    name, found = " -> ".join(edge), []
    if static and moving:
        apart = spread(transforms, np.concatenate([s.rows for s in tellings]))
        count = sum(len(s) for s in moving)
        also = f"on {static[0].topic} and, {count} times, on {moving[0].topic}"
        found.append(TreeFault("static and moving", name, count, apart, also))
    elif static:
        rows = np.concatenate([s.rows for s in static])
        apart = spread(transforms, rows)
        if apart > SAME:
            text = f"fixed on {static[0].topic}, and told differently: the last one holds"
            found.append(TreeFault("several values", name, len(rows), apart, text))
    return found


def spread(transforms: Table, rows: NDArray[np.int64]) -> float:
    """How far poses at rows (N,) lie from the first one at the most, in m plus rad at a metre."""
    return float(distance(transforms, rows, np.broadcast_to(rows[:1], rows.shape)).max(initial=0.0))


def distance(transforms: Table, rows: NDArray[np.int64], others: NDArray[np.int64]) -> Array:
    """(N,) how far apart poses at two sets of rows are, in m plus rad at one metre."""
    xyz, xyzw = transforms["translation_xyz"], transforms["rotation_xyzw"]
    shift = np.linalg.norm(xyz[rows] - xyz[others], axis=1)
    cosine = np.abs(np.sum(xyzw[rows] * xyzw[others], axis=1))
    return np.asarray(shift + 2.0 * np.arccos(np.clip(cosine, 0.0, 1.0)))


@dataclass(frozen=True)
class LooseFrame:
    """A frame that messages are in and that tf does not tie to the robot.

    Attributes:
        frame: its name.
        topics: who names it.
        of_sensor: whether measurements are taken in it.
        on_tf: whether tf has it, in another tree.
    """

    frame: str
    topics: tuple[str, ...]
    of_sensor: bool
    on_tf: bool


#: Table to the columns that name frames, and whether the first one is a sensor's own.
_NAMING = {
    "scans": (("frame_id",), True),
    "points": (("frame_id",), True),
    "imu": (("frame_id",), True),
    "odometry": (("frame_id", "child_frame_id"), False),
    "poses": (("frame_id", "child_frame_id"), False),
    "costmaps": (("frame_id",), False),
    "plans": (("frame_id",), False),
    "particles": (("frame_id",), False),
}


def loose_frames(
    read: Callable[[str], Table], buffer: TransformBuffer, base: str | None
) -> list[LooseFrame]:
    """Frames that messages name and that do not hang in the tree of the base, sensors' first.

    Of a log without any tf only the sensors' are told: the others are only names there.
    """
    named: dict[str, tuple[set[str], bool]] = {}
    for name, (columns, of_sensor) in _NAMING.items():
        table = read(name)
        for column in columns if len(table) else ():
            pairs = {*zip(table["topic"], table[column], strict=True)}
            for topic, frame in pairs:
                topics, sensor = named.get(clean_frame(frame), (set(), False))
                named[clean_frame(frame)] = ({*topics, topic}, sensor or of_sensor)
    known = {*buffer.frames()}
    found = []
    for frame, (topics, of_sensor) in sorted(named.items()):
        tied = base is not None and buffer.has_path(base, frame)
        if frame and frame != base and not tied and (of_sensor or known):
            found.append(LooseFrame(frame, tuple(sorted(topics)), of_sensor, frame in known))
    return sorted(found, key=lambda f: not f.of_sensor)
