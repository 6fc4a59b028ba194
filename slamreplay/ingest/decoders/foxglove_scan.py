"""foxglove.LaserScan: bearings from the first to the last, and a pose of the scan in its frame.

The schema has no range limits: the farthest return is taken for the laser's reach, which is the
least it can be. The pose's turn about the scan's axis goes into the bearings; upside down they
change their sign. A scan that lies elsewhere in its frame gets a frame of its own, "TOPIC/pose",
by rows of table transforms. Source: docs.foxglove.dev, schemas, LaserScan.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from slamreplay.geometry import se3
from slamreplay.ingest.decoders.checks import kept
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark
from slamreplay.ingest.decoders.foxglove import turned
from slamreplay.ingest.decoders.transforms import edge_rows

#: Beyond this tilt a scan does not lie in its frame's plane (see `ingest.lasers`).
_TILT_RAD = 0.1


def _decode(messages: Messages) -> Decoded:
    with np.errstate(over="ignore"):  # what is beyond float32 is infinite there
        ranges = messages.ragged("ranges", np.float32)
    start, end = messages.column("start_angle"), messages.column("end_angle")
    position = messages.columns("pose.position", "xyz")
    rotation, _ = turned(messages, "pose.orientation")
    R = se3.rotation_matrix(rotation)
    side = np.where(R[:, 2, 2] < 0.0, -1.0, 1.0)
    away = (position[:, :2] != 0.0).any(axis=1)
    frames = messages.frames("frame_id")
    own_frame = np.full(len(messages), f"{messages.topic.strip('/')}/pose", dtype=object)
    reach = ranges.values[np.isfinite(ranges.values)].max(initial=0.0)
    with np.errstate(invalid="ignore", over="ignore"):
        step = side * (end - start) / np.maximum(ranges.lengths - 1, 1)
        columns: dict[str, Any] = {
            "frame_id": np.where(away, own_frame, frames),
            "angle_min_rad": np.arctan2(R[:, 1, 0], R[:, 0, 0]) + side * start,
            "angle_increment_rad": step,
            "time_increment_s": np.zeros(len(messages)),
            "scan_time_s": np.zeros(len(messages)),
            "range_min_m": np.zeros(len(messages)),
            "range_max_m": np.full(len(messages), float(reach)),
            "ranges_m": ranges,
        }
    keep = np.ones(len(messages), dtype=bool)
    remarks = []
    for sound, reason in (
        (np.isfinite(start) & np.isfinite(step), "angles are not finite"),
        (ranges.lengths > 0, "a scan without ranges"),
        ((step != 0.0) | (ranges.lengths <= 1), "all beams at one angle"),
        (np.isfinite(R).all(axis=(1, 2)) & np.isfinite(position).all(axis=1), "pose not finite"),
        (np.abs(R[:, 2, 2]) >= np.cos(_TILT_RAD), "its pose tilts it out of its frame's plane"),
    ):
        remarks.append(Remark("lost", int((keep & ~sound).sum()), reason))
        keep &= sound
    stamps = messages.stamps("timestamp")
    scans = kept(keep, columns, messages.every, stamps, tuple(remarks))
    at = np.flatnonzero(keep & away)
    if not len(at):
        return scans
    level = np.tile([0.0, 0.0, 0.0, 1.0], (len(at), 1))  # the turn is in the bearings already
    edges = edge_rows(frames[at], own_frame[at], position[at], level, at, stamps[at])
    return replace(scans, also=(replace(edges, table="transforms"),))


LASER_SCAN = Decoder("scans", _decode)
