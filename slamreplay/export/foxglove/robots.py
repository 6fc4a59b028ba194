"""The two robots: poses, frames, paths, ellipses, footprints, and where they part."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3

from slamreplay.bundle.track import PoseTrack
from slamreplay.evidence import colours
from slamreplay.export.ellipse import outlines
from slamreplay.export.foxglove import topics
from slamreplay.export.foxglove.parts import Stream, line, pose, quaternion, stamp, update
from slamreplay.export.plane import pieces
from slamreplay.export.shown import BASE_BELIEVED, BASE_HINDSIGHT, Shown

#: Rows whose ellipses are worked out at a time.
_ROWS = 4096


def robots(shown: Shown) -> Iterator[Stream]:
    """Streams of both robots and of every run."""
    for topic, frame, track, colour in (
        (topics.BELIEF, BASE_BELIEVED, shown.belief, colours.BELIEF),
        (topics.HINDSIGHT, BASE_HINDSIGHT, shown.hindsight, colours.HINDSIGHT),
    ):
        if track is not None:
            yield _poses(topic, shown.frame_id, track)
            yield _transforms(shown.frame_id, frame, track)
            yield _path(topic, shown.frame_id, track, colour, shown.start_ns)
            yield _ellipses(topic, shown.frame_id, track, colour)
            yield _footprint(topic, frame, track, shown, colour)
    yield _parting(shown)
    for number, (name, track) in enumerate(shown.runs):
        topic = topics.run(name)
        frame, colour = track.frame_id, colours.RUNS[number % len(colours.RUNS)]
        yield _poses(topic, frame, track)
        yield _path(topic, frame, track, colour, shown.start_ns)


def _poses(topic: str, frame: str, track: PoseTrack) -> Stream:
    for row in np.flatnonzero(track.has_pose):
        t_ns = int(track.t_ns[row])
        yield (
            t_ns,
            topics.pose(topic),
            PoseInFrame(timestamp=stamp(t_ns), frame_id=frame, pose=pose(track.xyyaw[row])),
        )


def _transforms(parent: str, child: str, track: PoseTrack) -> Stream:
    for row in np.flatnonzero(track.has_pose):
        t_ns = int(track.t_ns[row])
        x, y, yaw = (float(v) for v in track.xyyaw[row])
        step = FrameTransform(
            timestamp=stamp(t_ns),
            parent_frame_id=parent,
            child_frame_id=child,
            translation=Vector3(x=x, y=y),
            rotation=quaternion(yaw),
        )
        yield t_ns, topics.TRANSFORMS, FrameTransforms(transforms=[step])


def _path(topic: str, frame: str, track: PoseTrack, colour: str, start_ns: int) -> Stream:
    """The whole of it from the start on, so that what is to come can be seen."""
    lines = [line(xy, colour, width_px=2.0) for xy in pieces(track.xyyaw[:, :2])]
    entity = SceneEntity(timestamp=stamp(start_ns), frame_id=frame, id="path", lines=lines)
    yield start_ns, topics.path(topic), update(entity)


def _ellipses(topic: str, frame: str, track: PoseTrack, colour: str) -> Stream:
    is_drawn = False
    for first in range(0, len(track), _ROWS):
        part = track.take(np.arange(first, min(first + _ROWS, len(track))))
        rings = outlines(part.xyyaw, part.cov)
        for t_ns, ring in zip(part.t_ns.tolist(), rings, strict=True):
            if not np.isfinite(ring).all():
                if is_drawn:
                    yield t_ns, topics.ellipse(topic), update()
                is_drawn = False
                continue
            ring_line = line(ring, colour, width_px=2.0, is_loop=True, z_m=0.03)
            entity = SceneEntity(
                timestamp=stamp(t_ns), frame_id=frame, id="95 %", lines=[ring_line]
            )
            yield t_ns, topics.ellipse(topic), update(entity)
            is_drawn = True


def _footprint(topic: str, frame: str, track: PoseTrack, shown: Shown, colour: str) -> Stream:
    """Told once: it is locked to its frame, which moves."""
    if shown.scene is None or len(shown.scene.footprint_xy) < 2:
        return
    t_ns = int(track.t_ns[np.argmax(track.has_pose)])
    edge = line(shown.scene.footprint_xy, colour, width_px=2.5, is_loop=True, z_m=0.04)
    entity = SceneEntity(
        timestamp=stamp(t_ns), frame_id=frame, id="footprint", frame_locked=True, lines=[edge]
    )
    yield t_ns, topics.outline(topic), update(entity)


def _parting(shown: Shown) -> Stream:
    """A line between both robots whenever they are farther apart than the verdict allows."""
    error, belief = shown.post.error, shown.post.belief_on_map
    if error is None or belief is None:
        return
    rows = shown.rows(error.t_ns)
    is_drawn = False
    for row in range(rows.start, rows.stop):
        t_ns = int(error.t_ns[row])
        if not error.distance_m[row] > shown.post.limits.position_m:
            if is_drawn:
                yield t_ns, topics.PARTING, update()
            is_drawn = False
            continue
        ends = np.array([belief.xyyaw[row, :2], error.where.xyyaw[row, :2]])
        entity = SceneEntity(
            timestamp=stamp(t_ns),
            frame_id=shown.frame_id,
            id="parting",
            lines=[line(ends, colours.VERMILLION, width_px=1.0, z_m=0.05)],
        )
        yield t_ns, topics.PARTING, update(entity)
        is_drawn = True
