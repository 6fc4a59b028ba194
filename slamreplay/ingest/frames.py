"""The tf tree of a log: settled so that it is one, and its map, odom and base."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import FrameEdge, Frames, LeftOutEdge, Loss
from slamreplay.ingest.names import basename, is_base_frame, is_map_frame, is_odom_frame
from slamreplay.ingest.rows import TopicRows

Pair = tuple[str, str]


@dataclass(frozen=True)
class _Edge:
    parent: str
    child: str
    samples: int
    is_static: bool
    is_constant: bool


@dataclass(frozen=True, eq=False)
class Settled:
    """Tf rows that form a forest, its edges, and what had to be left out or held."""

    topics: list[TopicRows]
    tree: list[FrameEdge]
    left_out: list[LeftOutEdge]
    losses: list[Loss]


def settle(topics: Sequence[TopicRows]) -> Settled:
    """Make a forest of tf rows.

    Rows of /tf_static are static, and so is an edge of /tf that never changes and does not carry
    the robot (ROS 1 publishes fixed joints that way): it is held at all times. Of several parents
    of a frame the one stays that connects more, then the one with more samples; a cycle loses its
    thinnest edge.
    """
    edges = _edges(topics)
    losses = []
    held = [e for e in edges.values() if e.is_constant and not e.is_static and not _carries(e)]
    for edge in held:
        edges[edge.parent, edge.child] = replace(edge, is_static=True)
    if held:
        count = sum(e.samples for e in held)
        what = "edge never changes" if len(held) == 1 else "edges never change"
        reason = f"{len(held)} {what}: held at all times"
        losses.append(Loss(kind="repaired", what="tf", count=count, reason=reason))
    seconds = _second_parents(edges)
    kept = {pair: edge for pair, edge in edges.items() if pair not in seconds}
    rings = _cycles(kept)
    left_out = []
    for pair, reason in sorted({**seconds, **rings}.items()):
        what, count = f"tf {pair[0]} -> {pair[1]}", edges[pair].samples
        losses.append(Loss(kind="skipped", what=what, count=count, reason=reason))
        left_out.append(
            LeftOutEdge(
                parent=pair[0],
                child=pair[1],
                samples=count,
                fault="cycle" if pair in rings else "second parent",
                reason=reason,
            )
        )
    kept = {pair: edge for pair, edge in kept.items() if pair not in rings}
    tree = [FrameEdge(parent=e.parent, child=e.child, is_static=e.is_static, samples=e.samples)
            for _, e in sorted(kept.items())]  # fmt: skip
    return Settled([_rows_of(topic, kept) for topic in topics], tree, left_out, losses)


def find_frames(
    tree: Sequence[FrameEdge],
    odometry: TopicRows | None,
    map_frames: Sequence[str],
    given: Mapping[str, str],
    is_disguise: Callable[[str, str, str], bool],
) -> Frames:
    """map, odom and base of a log.

    Args:
        tree: the settled tf edges.
        odometry: rows of the odometry topic, where there is one.
        map_frames: frames that poses in a map or a map itself are given in, best first.
        given: frames the user named ("map_frame", "odom_frame", "base_frame").
        is_disguise: whether a frame, beside an odom with a base, is a reference's and no map's.
    """
    moving = [e for e in tree if not e.is_static]
    known = {f for e in tree for f in (e.parent, e.child)}
    said_odom = (odometry.frame() or None) if odometry is not None else None
    said_base = (odometry.frame("child_frame_id") or None) if odometry is not None else None
    # Drivers may name frames that are not on tf ("wheel_odom"): what hangs together goes first.
    odom = given.get("odom_frame") or (said_odom if said_odom in known else None)
    odom = odom or _best([f for f in known if is_odom_frame(f)]) or said_odom
    base = given.get("base_frame") or (said_base if said_base in known else None)
    below = [e.child for e in moving if e.parent == odom and is_base_frame(e.child)]
    base = base or _best(below) or _best([f for f in known if is_base_frame(f)]) or said_base
    if odom is None and base is not None:  # no frame called odom: who moves the base
        parents = [e.parent for e in moving if e.child == base and not is_map_frame(e.parent)]
        odom = parents[0] if parents else None
    beside = {e.parent for e in tree if e.child == odom} | {
        e.child for e in tree if e.parent == odom and e.child != base
    }
    candidates = [f for f in sorted(beside) if is_map_frame(f)]
    if len(candidates) > 1 and odom is not None and base is not None:
        candidates = [f for f in candidates if not is_disguise(f, odom, base)] or candidates
    map_frame = given.get("map_frame") or _best(candidates)
    if map_frame is None:
        likely = [f for f in map_frames if f in beside] or [f for f in map_frames if f]
        map_frame = likely[0] if likely else _best([f for f in known if is_map_frame(f)])
    return Frames(map=map_frame, odom=odom, base=base, tree=list(tree))


def without_frame(
    frame: str, reference: str, frames: Frames, topics: Sequence[TopicRows]
) -> tuple[Frames, list[TopicRows], Loss]:
    """Frames and tf rows without the edges of a frame that only repeats a reference."""
    kept, count = [], 0
    for topic in topics:
        own = (topic.columns["parent_frame"] == frame) | (topic.columns["child_frame"] == frame)
        count += int(own.sum())
        kept.append(topic.take(np.flatnonzero(~own)))
    tree = [e for e in frames.tree if frame not in (e.parent, e.child)]
    reason = f"repeats the reference {reference}, which only judges"
    loss = Loss(kind="skipped", what=f"tf frame {frame}", count=count, reason=reason)
    return frames.model_copy(update={"tree": tree}), kept, loss


def direct_pose(topics: Sequence[TopicRows], frames: Frames) -> TopicRows | None:
    """Rows of table poses from a tf edge map -> base, as SLAM without an odom publishes it."""
    for topic in topics:
        columns = topic.columns
        mine = (columns["parent_frame"] == frames.map) & (columns["child_frame"] == frames.base)
        index = np.flatnonzero(mine & ~columns["is_static"])
        if len(index):
            rows = topic.take(index)
            n = len(index)
            poses = {
                "frame_id": rows.columns["parent_frame"],
                "child_frame_id": rows.columns["child_frame"],
                "source": np.full(n, "tf", dtype=object),
                "position_xyz": rows.columns["translation_xyz"],
                "orientation_xyzw": rows.columns["rotation_xyzw"],
                "covariance": np.full((n, 36), np.nan),
            }
            return replace(rows, table="poses", columns=poses, messages=n)
    return None


def _best(frames: Sequence[str]) -> str | None:
    """The plainest name: REP-105's own spelling first, then the shortest."""
    plain = ("map", "odom", "base_footprint", "base_link")
    rank = {name: place for place, name in enumerate(plain)}
    ordered = sorted(frames, key=lambda f: (rank.get(basename(f), len(plain)), len(f), f))
    return ordered[0] if ordered else None


def _edges(topics: Sequence[TopicRows]) -> dict[Pair, _Edge]:
    static: dict[Pair, bool] = {}
    poses: dict[Pair, list[NDArray[np.float64]]] = defaultdict(list)
    for topic in topics:
        is_static = topic.topic.endswith("tf_static")
        pairs = np.array([topic.columns["parent_frame"], topic.columns["child_frame"]], dtype=str)
        if not pairs.shape[1]:
            continue
        unique, inverse = np.unique(pairs, axis=1, return_inverse=True)
        numbers = np.hstack([topic.columns["translation_xyz"], topic.columns["rotation_xyzw"]])
        for index, (parent, child) in enumerate(unique.T):
            pair = (str(parent), str(child))
            poses[pair].append(numbers[np.ravel(inverse) == index])
            static[pair] = static.get(pair, True) and is_static
    edges = {}
    for pair, parts in sorted(poses.items()):
        rows = np.concatenate(parts)
        constant = bool(np.all(np.ptp(rows, axis=0) < 1e-9))
        edges[pair] = _Edge(*pair, len(rows), static[pair], constant)
    return edges


def _carries(edge: _Edge) -> bool:
    """Whether the edge is one that moves with the robot, even if the robot stood still."""
    return any(is_odom_frame(f) or is_map_frame(f) for f in (edge.parent, edge.child))


def _second_parents(edges: Mapping[Pair, _Edge]) -> dict[Pair, str]:
    parents = defaultdict(list)
    for parent, child in edges:
        parents[child].append(parent)
    dropped = {}
    for child, several in parents.items():
        if len(several) > 1:
            sizes = {p: _component(p, edges, without=child) for p in several}
            best = max(several, key=lambda p: (sizes[p], edges[p, child].samples, p))
            for parent in several:
                if parent != best:
                    dropped[parent, child] = f"a second parent of {child}, {best} is kept"
    return dropped


def _component(frame: str, edges: Mapping[Pair, _Edge], without: str) -> int:
    """Frames that hang together with `frame` when `without` is taken away."""
    seen, todo = {frame}, [frame]
    while todo:
        here = todo.pop()
        for parent, child in edges:
            if without not in (parent, child) and here in (parent, child):
                other = child if here == parent else parent
                if other not in seen:
                    seen.add(other)
                    todo.append(other)
    return len(seen)


def _cycles(edges: Mapping[Pair, _Edge]) -> dict[Pair, str]:
    """One edge of each cycle; every frame has one parent here."""
    parent_of = {child: parent for parent, child in edges}
    dropped: dict[Pair, str] = {}
    for start in sorted(parent_of):
        line = [start]
        while (above := parent_of.get(line[-1])) is not None and above not in line:
            line.append(above)
        if above is None:
            continue
        ring = line[line.index(above) :]
        pairs = [(parent_of[f], f) for f in ring]
        thinnest = min(pairs, key=lambda p: (edges[p].is_static, edges[p].samples, p))
        dropped[thinnest] = f"closes a cycle: {' -> '.join([*ring, ring[0]])}"
        del parent_of[thinnest[1]]
    return dropped


def _rows_of(topic: TopicRows, edges: Mapping[Pair, _Edge]) -> TopicRows:
    pairs = list(zip(topic.columns["parent_frame"], topic.columns["child_frame"], strict=True))
    index = np.flatnonzero(np.array([pair in edges for pair in pairs], dtype=bool))
    rows = topic.take(index)
    static = np.array([edges[pairs[i]].is_static for i in index], dtype=bool)
    return replace(rows, columns={**rows.columns, "is_static": static})
