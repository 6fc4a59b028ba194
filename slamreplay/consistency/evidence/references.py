"""The best independent idea of the truth that a log has."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.bundle.findings import Finding
from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.schema import SENSED_KINDS
from slamreplay.bundle.sightings import KINDS
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.consistency.evidence.laid_onto import laid_onto
from slamreplay.consistency.evidence.source import Reference
from slamreplay.consistency.evidence.spatial_track import SpatialTrack
from slamreplay.consistency.evidence.summaries import summaries_of
from slamreplay.geometry import se2, se3
from slamreplay.geometry.covariance import planar_from_ros, ros_turned
from slamreplay.geometry.transforms import TransformBuffer, clean_frame

#: Best first. Hindsight comes after all of them: it is made of the robot's own scans, so it can
#: show that a belief is over-confident and never that it is consistent.
ORDER = ("simulation", "motion_capture", "survey", "gnss", "fiducial", "dock")


@dataclass(frozen=True, eq=False)
class Candidate:
    """A reference topic: its poses of the base, or why they cannot be held against the belief.

    Attributes:
        kind: simulation, motion_capture, ...
        topic: it came from.
        track: of the base in `frames.map`, or in the reference's own frame.
        refusal: None where the track may be used.
        only_frame: whether the frame is all that is wrong with it.
        spatial: the track in space; None where it never leaves the plane.
    """

    kind: str
    topic: str
    track: PoseTrack
    refusal: str | None
    only_frame: bool = False
    spatial: SpatialTrack | None = None


def references_of(bundle: Bundle, hindsight: Hindsight | None) -> tuple[Reference, ...]:
    """Base in map from every usable reference of the log, the best first, hindsight last.

    For metrics only: it reads the kinds that estimators and the verdict must not see.
    """
    usable = [
        Reference(c.kind, c.topic, c.track, c.spatial)
        for c in candidates(bundle)
        if c.refusal is None
    ]
    if hindsight is not None and hindsight.track.has_pose.any():
        usable.append(Reference("hindsight", "hindsight", hindsight.track))
    return tuple(usable)


def unused_references(bundle: Bundle, updates: PoseTrack | None = None) -> tuple[Finding, ...]:
    """One finding for each reference in the log that cannot be held against the belief.

    Not of tags and docks, which are no poses of the robot, and of satellite fixes only where their
    frame is not tied to the map. Of a reference that only its frame keeps away the finding says
    what the updates (N rows) of a belief would show, were it laid onto them.
    """
    target = bundle.manifest.frames.map or "map"
    told = []
    for c in candidates(bundle):
        if c.refusal is None or c.kind in KINDS:
            continue
        if c.kind == "gnss" and c.track.frame_id == target:
            continue
        what, used = c.kind.replace("_", " "), "was not used"
        if c.kind in SENSED_KINDS:  # it may well have joined hindsight
            used = "was not held against the belief"
        told.append(Finding(
            "SR-CON-003",
            "info",
            f"the {what} reference {c.topic} {used}: {c.refusal}{_laid(c, updates)}",
            start_ns=int(c.track.t_ns[0]),
            end_ns=int(c.track.t_ns[-1]),
            n=len(c.track),
        ))  # fmt: skip
    return tuple(told)


def _laid(candidate: Candidate, updates: PoseTrack | None) -> str:
    if updates is None or not candidate.only_frame:
        return ""
    evidence = laid_onto(updates, candidate.track, candidate.topic, candidate.kind)
    if evidence is None:
        return ""
    sentences = "; ".join(s.sentence for _, s in summaries_of(evidence, updates))
    return (
        ". Aligned to the belief, which takes out whatever is always wrong in it (how much that "
        f"matters, no judgement), {sentences}"
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
    position, R = rows["position_xyz"], se3.rotation_matrix(rows["orientation_xyzw"])
    cov = rows["covariance"]
    # Only static transforms may tie them: a way through the odometry frame runs through the
    # localizer's own correction, and would hold the belief against itself.
    T = buffer.fixed(target, frame)
    if T is not None:
        position, R = position @ T[:3, :3].T + T[:3, 3], T[:3, :3] @ R
        cov, frame = ros_turned(cov, T[:3, :3]), target
    xyyaw = np.column_stack([position[:, :2], np.arctan2(R[:, 1, 0], R[:, 0, 0])])
    T_frame_child = se3.from_parts(R, position)
    spatial = SpatialTrack(frame, rows.t_ns, T_frame_child, cov.reshape(-1, 6, 6))
    refusal = None
    if kind in KINDS and child and child != base:
        refusal = "it says where the robot saw a thing"
    elif child and child != base and buffer.has_path(child, base):
        step, known = buffer.lookup(child, base, rows.t_ns)
        xyyaw = np.where(known[:, None], se2.compose(xyyaw, se3.planar(step)), np.nan)
        spatial = spatial.mounted(np.where(known[:, None, None], step, np.nan))
        if not np.isfinite(xyyaw[:, :2]).any():
            refusal = f"where '{child}' is does not say where the robot is without a heading"
    elif child and child != base:
        refusal = f"it poses '{child}', whose place on the robot is not in tf"
    track = PoseTrack(frame, base, rows.t_ns, xyyaw, planar_from_ros(cov))
    only_frame = T is None and refusal is None and bool(track.has_pose.any())
    if T is None:
        refusal = f"its frame is '{frame}', and no static transform ties that to '{target}' (who "
        refusal += "knows it gives reference_in_map: [x_m, y_m, yaw_deg] in a topics file)"
    in_space = spatial if spatial.leaves_plane else None
    return Candidate(kind, topic, track, refusal, only_frame, in_space)
