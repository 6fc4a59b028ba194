"""The two robots: where they are, how sure, and what their lasers met; and runs beside them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import rerun as rr

from slamreplay.bundle.track import PoseTrack
from slamreplay.evidence import colours
from slamreplay.evidence.scene import Met, SceneScans
from slamreplay.export.ellipse import outlines
from slamreplay.export.plane import pieces
from slamreplay.export.rerun.batches import (
    closed,
    in_space,
    line_look,
    point_look,
    rgba,
    send_lines,
    send_points,
)
from slamreplay.export.rerun.sink import Sink
from slamreplay.export.shown import Shown, poses_at
from slamreplay.geometry.se3 import quaternion_from_yaw

_BEAMS = np.array([rgba(colours.BEAMS[met]) for met in sorted(Met)], dtype=np.uint32)


def draw_robots(shown: Shown, sink: Sink) -> None:
    """Both robots, where they part, particles and plans, and the paths of runs."""
    for name, track, colour in (
        ("belief", shown.belief, colours.BELIEF),
        ("hindsight", shown.hindsight, colours.HINDSIGHT),
    ):
        if track is not None:
            _draw_robot(f"map/{name}", track, colour, shown, sink)
    for number, pieces_of_scans in enumerate(shown.lasers, start=1):
        _draw_scans(number, pieces_of_scans(), shown, sink)
    _draw_parting(shown, sink)
    _draw_particles_and_plans(shown, sink)
    for number, (name, track) in enumerate(shown.runs):
        frame = track.frame_id
        space = ["map"] if frame == shown.frame_id else ["frames", frame]
        entity = rr.new_entity_path([*space, "runs", name])
        _draw_path(entity, track, sink, colours.RUNS[number % len(colours.RUNS)])


def _draw_robot(entity: str, track: PoseTrack, colour: str, shown: Shown, sink: Sink) -> None:
    """Its pose is a transform, so that its outline and its scans, which lie below, move along."""
    known = track.take(track.has_pose)
    turn = quaternion_from_yaw(known.xyyaw[:, 2])
    place = np.column_stack([known.xyyaw[:, :2], np.zeros(len(known))])
    sink.send(entity, known.t_ns, rr.Transform3D.columns(translation=place, quaternion=turn))
    sink.always(f"{entity}/heading", rr.Arrows3D(vectors=[[0.6, 0, 0]], colors=[rgba(colour)]))
    _draw_path(f"{entity}_path", track, sink, colour)
    rings = outlines(track.xyyaw, track.cov)
    is_known = np.asarray(np.isfinite(rings).all(axis=(1, 2)))
    lines = [[closed(r, 0.03)] if known else [] for r, known in zip(rings, is_known, strict=True)]
    send_lines(sink, f"{entity}_ellipse", track.t_ns, lines)
    sink.always(f"{entity}_ellipse", line_look(colour, 2.0))
    if shown.scene is None:
        return
    edge = closed(shown.scene.footprint_xy, 0.04)
    sink.always(f"{entity}/footprint", rr.LineStrips3D([edge], colors=[rgba(colour)]))


def _draw_scans(number: int, pieces: Iterable[SceneScans], shown: Shown, sink: Sink) -> None:
    """Returns in the base frame of each robot; none while nobody knows where that is."""
    name = "scan" if number == 1 else f"scan_{number}"
    robots = [
        (f"map/{robot}/{name}", track)
        for robot, track in (("belief", shown.belief), ("hindsight", shown.hindsight))
        if track is not None
    ]
    for scans in pieces:
        rows = shown.rows(scans.t_ns)
        for entity, track in robots:
            is_known = np.isfinite(poses_at(track, scans.t_ns[rows])).all(axis=1)
            kept = scans.is_hit[rows] & np.asarray(is_known)[:, None]
            columns = rr.Points3D.columns(
                positions=in_space(scans.ends_m[rows][kept], 0.02),
                colors=_BEAMS[scans.met[rows][kept]],
            )
            sink.send(entity, scans.t_ns[rows], columns.partition(kept.sum(axis=1)))
    for entity, _ in robots:
        sink.always(entity, point_look(2.0))


def _draw_path(entity: str, track: PoseTrack, sink: Sink, colour: str) -> None:
    """All of it at all times, so that what is to come can be seen."""
    strips = [in_space(xy) for xy in pieces(track.xyyaw[:, :2])]
    sink.always(entity, rr.LineStrips3D(strips), line_look(colour, 2.0))


def _draw_parting(shown: Shown, sink: Sink) -> None:
    """A line between both robots whenever they are farther apart than the verdict allows."""
    error, belief = shown.post.error, shown.post.belief_on_map
    if error is None or belief is None:
        return
    rows = shown.rows(error.t_ns)
    is_apart = error.distance_m[rows] > shown.post.limits.position_m
    ends = np.stack([belief.xyyaw[rows, :2], error.where.xyyaw[rows, :2]], axis=1)
    lines = [[in_space(e, 0.05)] if apart else [] for e, apart in zip(ends, is_apart, strict=True)]
    send_lines(sink, "map/parting", error.t_ns[rows], lines)
    sink.always("map/parting", line_look(colours.VERMILLION, 1.0))


def _draw_particles_and_plans(shown: Shown, sink: Sink) -> None:
    clouds, plans = shown.clouds, shown.plans
    if clouds is not None:
        rows = shown.rows(clouds.t_ns)
        for row in range(rows.start, rows.stop):
            own = clouds.xyyaw[clouds.first[row] : clouds.first[row + 1], :2]
            send_points(sink, "map/particles", clouds.t_ns[[row]], [in_space(own, 0.02)])
        sink.always("map/particles", point_look(1.5, colours.BELIEF))
    if plans is not None:
        rows = shown.rows(plans.t_ns)
        first = plans.first.tolist()
        paths = [plans.xy[first[row] : first[row + 1]] for row in range(rows.start, rows.stop)]
        send_lines(sink, "map/plan", plans.t_ns[rows], [[in_space(xy, 0.01)] for xy in paths])
        sink.always("map/plan", line_look(colours.GREEN, 1.5))
