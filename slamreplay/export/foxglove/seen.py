"""What the robot saw: scans at both poses with the class of every beam, particles and plans."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from numpy.typing import NDArray

from slamreplay.evidence import colours
from slamreplay.evidence.scene import SceneClouds, ScenePlans, SceneScans
from slamreplay.export.foxglove import topics
from slamreplay.export.foxglove.parts import Stream, fields, line, pose, stamp, update
from slamreplay.export.shown import Shown, poses_at

#: A return: where it ended in the base frame, its colour, and its class (of `Met`).
_BEAM = np.dtype(
    [(name, "<f4") for name in ("x", "y", "z")]
    + [(name, "u1") for name in ("red", "green", "blue", "alpha", "met")]
)
#: Particles are points and not poses: viewers draw a thousand arrows slowly.
_PARTICLE = np.dtype([(name, "<f4") for name in ("x", "y", "z", "yaw")])
_RGB = np.array([colours.rgb(colours.BEAMS[met]) for met in sorted(colours.BEAMS)], dtype=np.uint8)


def seen(shown: Shown) -> Iterator[Stream]:
    """Streams of scans, particles and plans; nothing without a scene."""
    scene = shown.scene
    if scene is None:
        return
    for number, pieces in enumerate(shown.lasers, start=1):
        yield _scans(number, pieces(), shown)
    if scene.clouds is not None:
        yield _particles(scene.clouds, shown)
    if scene.plans is not None:
        yield _plans(scene.plans, shown)


def _scans(number: int, pieces: Iterable[SceneScans], shown: Shown) -> Stream:
    """Each scan in the map frame, its origin the pose of one robot and of the other."""
    robots = [
        (topics.scan(robot, number), track)
        for robot, track in ((topics.BELIEF, shown.belief), (topics.HINDSIGHT, shown.hindsight))
        if track is not None
    ]
    is_drawn = [False] * len(robots)
    for scans in pieces:
        rows = shown.rows(scans.t_ns)
        poses = [poses_at(track, scans.t_ns) for _, track in robots]
        for row in range(rows.start, rows.stop):
            beams = _beams(scans, row)
            for k, (topic, _) in enumerate(robots):
                t_ns, at = int(scans.t_ns[row]), poses[k][row]
                is_known = bool(np.isfinite(at).all())
                if is_known:
                    yield t_ns, topic, _cloud(t_ns, shown.frame_id, at, beams)
                elif is_drawn[k]:  # what was drawn before is taken away
                    yield t_ns, topic, _cloud(t_ns, shown.frame_id, np.zeros(3), beams[:0])
                is_drawn[k] = is_known


def _beams(scans: SceneScans, row: int) -> NDArray:
    """What returned."""
    hit = scans.is_hit[row]
    met = scans.met[row][hit]
    beams = np.zeros(len(met), dtype=_BEAM)
    beams["x"], beams["y"] = scans.ends_m[row][hit].T
    for channel, name in enumerate(("red", "green", "blue")):
        beams[name] = _RGB[met, channel]
    beams["alpha"], beams["met"] = 255, met
    return beams


def _particles(clouds: SceneClouds, shown: Shown) -> Stream:
    rows = shown.rows(clouds.t_ns)
    for row in range(rows.start, rows.stop):
        own = clouds.xyyaw[clouds.first[row] : clouds.first[row + 1]]
        points = np.zeros(len(own), dtype=_PARTICLE)
        points["x"], points["y"], points["yaw"] = own.T
        t_ns = int(clouds.t_ns[row])
        yield t_ns, topics.PARTICLES, _cloud(t_ns, shown.frame_id, np.zeros(3), points)


def _cloud(t_ns: int, frame: str, at: NDArray, points: NDArray) -> PointCloud:
    return PointCloud(
        timestamp=stamp(t_ns),
        frame_id=frame,
        pose=pose(at, z_m=0.02),
        point_stride=points.dtype.itemsize,
        fields=fields(points.dtype),
        data=points.tobytes(),
    )


def _plans(plans: ScenePlans, shown: Shown) -> Stream:
    rows = shown.rows(plans.t_ns)
    for row in range(rows.start, rows.stop):
        t_ns = int(plans.t_ns[row])
        xy = plans.xy[plans.first[row] : plans.first[row + 1]]
        lines = [line(xy, colours.GREEN, width_px=1.5, z_m=0.01)] if len(xy) > 1 else []
        entity = SceneEntity(timestamp=stamp(t_ns), frame_id=shown.frame_id, id="plan", lines=lines)
        yield t_ns, topics.PLAN, update(entity)
