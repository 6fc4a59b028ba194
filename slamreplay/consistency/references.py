"""The best independent idea of the truth that a log has."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.findings import Finding
from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.schema import SENSED_KINDS
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.consistency.evidence import Reference
from slamreplay.geometry import se2, se3
from slamreplay.geometry.covariance import planar_from_ros, turned
from slamreplay.geometry.transforms import TransformBuffer, clean_frame

#: Best first. Hindsight comes after all of them: it is made of the robot's own scans, so it can
#: show that a belief is over-confident and never that it is consistent.
ORDER = ("simulation", "motion_capture", "survey", "gnss", "fiducial", "dock")


@dataclass(frozen=True, eq=False)
class Candidate:
    """A reference topic: its poses of the base, or why they cannot be held against the belief."""

    kind: str
    topic: str
    track: PoseTrack
    refusal: str | None


def references_of(bundle: Bundle, hindsight: Hindsight | None) -> tuple[Reference, ...]:
    """Base in map from every usable reference of the log, the best first, hindsight last.

    For metrics only: it reads the kinds that estimators and the verdict must not see.
    """
    usable = [Reference(c.kind, c.topic, c.track) for c in candidates(bundle) if c.refusal is None]
    if hindsight is not None and hindsight.track.has_pose.any():
        usable.append(Reference("hindsight", "hindsight", hindsight.track))
    return tuple(usable)


def unused_references(bundle: Bundle) -> tuple[Finding, ...]:
    """One finding for each judging reference in the log that cannot be held against the belief."""
    return tuple(
        Finding(
            "SR-CON-003",
            "info",
            f"the {c.kind.replace('_', ' ')} reference {c.topic} was not used: {c.refusal}",
            start_ns=int(c.track.t_ns[0]),
            end_ns=int(c.track.t_ns[-1]),
            n=len(c.track),
        )
        for c in candidates(bundle)
        if c.refusal is not None and c.kind not in SENSED_KINDS
    )


def candidates(bundle: Bundle) -> tuple[Candidate, ...]:
    """Every reference topic, best kind first, within a kind the one with the most poses."""
    table = bundle.table("references")
    buffer = bundle.view().transforms
    found = []
    kinds, topics = table["kind"].astype(str), table["topic"].astype(str)
    for kind, topic in sorted(set(zip(kinds, topics, strict=True))):
        rows = table.take((kinds == kind) & (topics == topic))
        found.append(_candidate(bundle, buffer, rows, kind, topic))
    rank = {kind: i for i, kind in enumerate(ORDER)}
    return tuple(sorted(found, key=lambda c: (rank.get(c.kind, len(rank)), -len(c.track))))


def _candidate(
    bundle: Bundle, buffer: TransformBuffer, rows: Table, kind: str, topic: str
) -> Candidate:
    frames = bundle.manifest.frames
    rows = rows.sorted_by_time()
    frame, child = (clean_frame(str(rows[name][0])) for name in ("frame_id", "child_frame_id"))
    base = frames.base or child or "base_link"
    target = frames.map or "map"
    yaw = se3.yaw_from_quaternion(rows["orientation_xyzw"])
    xyyaw = np.column_stack([rows["position_xyz"][:, :2], yaw])
    cov = planar_from_ros(rows["covariance"])
    refusal = None
    if child and child != base:
        if buffer.has_path(child, base):
            T, known = buffer.lookup(child, base, rows.t_ns)
            xyyaw = np.where(known[:, None], se2.compose(xyyaw, se3.planar(T)), np.nan)
        else:
            refusal = f"it poses '{child}', whose place on the robot is not in tf"
    if frame != target:
        # Only static transforms may tie them: a way through the odometry frame runs through the
        # localizer's own correction, and would hold the belief against itself.
        if buffer.has_path(target, frame) and all(
            edge.is_static for edge in buffer.path(target, frame)
        ):
            T, _ = buffer.lookup(target, frame, rows.t_ns[:1])
            offset = se3.planar(T)[0]
            xyyaw = se2.compose(offset, xyyaw)
            cov = turned(cov, np.broadcast_to(offset[2], len(cov)))
            frame = target
        else:
            refusal = f"its frame is '{frame}', and no static transform ties that to '{target}'"
    return Candidate(kind, topic, PoseTrack(frame, base, rows.t_ns, xyyaw, cov), refusal)
