"""A second laser: one that stands elsewhere on the robot, not the first one told twice.

Robots with two lasers log them beside filtered copies (same frame) and beside merges of both. A
copy or a merge repeats ranges to the millimetre; two lasers that look at one wall differ by their
noise. So content decides, after the frames have.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Frames, Loss
from slamreplay.bundle.no_return import is_code, tally
from slamreplay.geometry import se3
from slamreplay.geometry.times import NO_STAMP
from slamreplay.geometry.transforms import Edge, TransformBuffer
from slamreplay.ingest.names import tokens
from slamreplay.ingest.roles import Choice
from slamreplay.ingest.rows import TopicRows
from slamreplay.ingest.valid_beams import valid_beams

#: A range that is told again differs by rounding; independent lasers differ by centimetres.
_SAME_M = 0.003
#: Share of one laser's beams that a copy or a merge holds again. Beams behind the robot's own
#: posts are left out of merges; independent lasers agree this closely by chance in under half.
_REPEATED = 0.8
#: A mount that moves by more than this during the log (a tilting laser) is none to build on.
_FIXED_M, _FIXED_RAD = 0.02, 0.02
#: Beyond this tilt a beam leaves the map's plane by a metre within ten.
_TILT_RAD = 0.1
_FEWEST_BEAMS = 20
_LOOKS = 40
#: Scans that are looked at in one go where all of them are.
_AT_ONCE = 5000


def second_scan(
    topics: Sequence[TopicRows], first: Choice, tf: Sequence[TopicRows], frames: Frames
) -> tuple[Choice, Choice | None]:
    """The best laser beside the first, and the first with what was said of the others.

    Args:
        topics: candidates of any table; only scans are looked at.
        first: the topic that plays `scan`.
        tf: settled rows of table transforms.
        frames: of the log.
    """
    others = [t for t in topics if t.table == "scans" and len(t) and t is not first.rows]
    if not others:
        return first, None
    buffer = TransformBuffer(_edges(tf))
    fitting: list[TopicRows] = []
    remarks = []
    for topic in sorted(others, key=lambda t: (-valid_beams(t), len(tokens(t.topic)), t.topic)):
        remark = _objection(topic, first.rows, buffer, frames.base)
        if remark is None and fitting:
            remark = f"not used beside {first.rows.topic} and {fitting[0].topic}"
        if remark is None:
            fitting.append(topic)
        else:
            remarks.append(f"{topic.topic}: {remark}")
    reason = "; ".join([first.reason, *remarks])
    second = None
    if fitting:
        frame = fitting[0].frame()
        second = Choice(fitting[0], f"another laser, in {frame}, that tells what no other does")
    return Choice(first.rows, reason), second


def _objection(
    topic: TopicRows, first: TopicRows, buffer: TransformBuffer, base: str | None
) -> str | None:
    """Why a topic is no second laser beside the first, or None."""
    if topic.frame() == first.frame():
        return f"in the frame of {first.topic}, so the same laser again"
    if valid_beams(topic) < _FEWEST_BEAMS * len(topic):
        return "hardly any valid beams"
    own, other = (_mount(buffer, base, laser.frame()) for laser in (topic, first))
    if isinstance(own, str):
        return f"{topic.frame() or 'its frame'} {own}"
    if isinstance(other, str):
        return f"{first.frame() or 'its frame'} {other}"
    if _repeats(first, other, topic, own) >= _REPEATED:
        return f"{first.topic} holds its beams already"
    if _repeats(topic, own, first, other) >= _REPEATED:
        return f"holds the beams of {first.topic} again"
    return None


def _mount(buffer: TransformBuffer, base: str | None, frame: str) -> NDArray[np.float64] | str:
    """T_base_laser (4, 4) of a laser that sits still and level, or why it is none."""
    if base is None or not frame or not buffer.has_path(base, frame):
        return "is not on tf, so its place is unknown"
    moving = [e.t_ns for e in buffer.path(base, frame) if not e.is_static]
    times = np.unique(np.concatenate(moving)) if moving else np.zeros(1, dtype=np.int64)
    poses, valid = buffer.lookup(base, frame, times)
    poses = poses[valid]
    if not len(poses):
        return "is not on tf, so its place is unknown"
    T = poses[len(poses) // 2]
    turned = se3.inverse(T) @ poses
    cosine = np.clip((np.trace(turned[:, :3, :3], axis1=1, axis2=2) - 1.0) / 2.0, -1.0, 1.0)
    shift = np.linalg.norm(turned[:, :3, 3], axis=1)
    if np.max(np.arccos(cosine)) > _FIXED_RAD or np.max(shift) > _FIXED_M:
        return "moves on the robot"
    if abs(T[2, 2]) < np.cos(_TILT_RAD):
        return "does not look along the map's plane"
    return np.asarray(T)


def _repeats(
    holder: TopicRows,
    T_base_holder: NDArray[np.float64],
    held: TopicRows,
    T_base_held: NDArray[np.float64],
) -> float:
    """Share of the beams of `held` that `holder` tells again, in the best quarter of looks.

    A merge puts each end of a beam into the bin of its bearing and keeps the range; looks while the
    robot stands or both stamps agree are exact, the others are not worth asking.
    """
    T_holder_held = se3.inverse(T_base_holder) @ T_base_held
    held_ns, holder_ns = _times(held), _times(holder)
    order = np.argsort(holder_ns, kind="stable")
    rows = np.unique(np.linspace(0, len(held) - 1, min(_LOOKS, len(held))).astype(int))
    shares = []
    for row in rows:
        at = np.searchsorted(holder_ns[order], held_ns[row])
        near = order[max(at - 1, 0) : at + 1]
        match = near[np.argmin(np.abs(holder_ns[near] - held_ns[row]))]
        shares.append(_told_again(holder, int(match), held, int(row), T_holder_held))
    return float(np.quantile(shares, 0.75)) if shares else 0.0


def _told_again(
    holder: TopicRows, at: int, held: TopicRows, row: int, T_holder_held: NDArray[np.float64]
) -> float:
    ranges, bearings = _beams(held, row)
    zeros = np.zeros_like(ranges)
    ends = np.column_stack([ranges * np.cos(bearings), ranges * np.sin(bearings), zeros])
    ends = ends @ T_holder_held[:3, :3].T + T_holder_held[:3, 3]
    reach, bearing = np.hypot(ends[:, 0], ends[:, 1]), np.arctan2(ends[:, 1], ends[:, 0])
    told = holder.columns["ranges_m"][at]
    step = holder.columns["angle_increment_rad"][at]
    if step == 0.0 or not len(told) or not len(ends):
        return 0.0
    start = holder.columns["angle_min_rad"][at]
    beam = np.rint(np.mod((bearing - start) * np.sign(step), 2.0 * np.pi) / abs(step)).astype(int)
    same = np.zeros(len(reach), dtype=bool)
    for neighbour in (-1, 0, 1):
        index = beam + neighbour
        inside = (index >= 0) & (index < len(told))
        with np.errstate(invalid="ignore"):
            same |= inside & (np.abs(told[np.where(inside, index, 0)] - reach) < _SAME_M)
    return float(same.mean())


def _beams(topic: TopicRows, row: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Ranges and bearings of the valid beams of one scan."""
    c = topic.columns
    ranges = c["ranges_m"][row].astype(np.float64)
    bearings = c["angle_min_rad"][row] + np.arange(len(ranges)) * c["angle_increment_rad"][row]
    with np.errstate(invalid="ignore"):
        valid = (ranges >= c["range_min_m"][row]) & (ranges < c["range_max_m"][row])
    valid &= np.isfinite(ranges) & (ranges > 0.0)
    return ranges[valid], bearings[valid]


def no_returns(topics: Sequence[TopicRows]) -> list[Loss]:
    """How many beams drivers told as range_max for want of +inf; the bundle keeps them so."""
    losses = []
    for topic in topics:
        if topic.table != "scans" or not len(topic):
            continue
        at, before = 0, 0
        for start in range(0, len(topic), _AT_ONCE):
            # Asked for anew each time: columns on disk are in memory while somebody holds them.
            rows = slice(start, min(start + _AT_ONCE, len(topic)))
            ranges = topic.columns["ranges_m"].rows(rows.start, rows.stop)
            told = tally(ranges.values, ranges.spread(topic.columns["range_max_m"][rows]))
            at, before = at + told[0], before + told[1]
        count = at if is_code(at, before) else 0
        if count:
            reason = "beams of exactly range_max are read as beams without a return"
            losses.append(Loss(kind="repaired", what=topic.topic, count=count, reason=reason))
    return losses


def _times(topic: TopicRows) -> NDArray[np.int64]:
    stamped = topic.t_sensor_ns != NO_STAMP
    return topic.t_sensor_ns if stamped.all() else topic.t_log_ns


def _edges(tf: Sequence[TopicRows]) -> list[Edge]:
    """Edges of tf rows on their own stamps: mounts need no common clock."""
    found: dict[tuple[str, str], list[tuple[TopicRows, NDArray[np.int64]]]] = {}
    for topic in tf:
        names = np.array([topic.columns["parent_frame"], topic.columns["child_frame"]], dtype=str)
        if not names.shape[1]:
            continue
        pairs, inverse = np.unique(names, axis=1, return_inverse=True)
        for i, (parent, child) in enumerate(pairs.T):
            rows = np.flatnonzero(np.ravel(inverse) == i)
            found.setdefault((str(parent), str(child)), []).append((topic, rows))
    edges = []
    for (parent, child), parts in sorted(found.items()):
        t_ns = np.concatenate([_times(t)[rows] for t, rows in parts])
        xyz = np.concatenate([t.columns["translation_xyz"][rows] for t, rows in parts])
        xyzw = np.concatenate([t.columns["rotation_xyzw"][rows] for t, rows in parts])
        static = all(bool(t.columns["is_static"][rows].all()) for t, rows in parts)
        t_ns, first = np.unique(t_ns, return_index=True)
        edges.append(Edge(parent, child, t_ns, xyz[first], xyzw[first], static))
    return edges
