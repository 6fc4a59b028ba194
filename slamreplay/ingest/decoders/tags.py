"""Tags and landmarks of other detectors: Isaac ROS, ArUco, ar_track_alvar, Cartographer.

Rows as `fiducials` makes them. A marker's own header goes before that of the list it is in: some
detectors fill only one of both.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry.covariance import ANY_ANGLE
from slamreplay.geometry.times import NO_STAMP, Times
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark
from slamreplay.ingest.decoders.fiducials import pose_of, tag_rows


def _isaac(messages: Messages) -> Decoded:
    seen, rows = messages.children("detections")
    return tag_rows(
        messages.frames()[rows],
        messages.stamps()[rows],
        rows,
        pose_of(seen, "pose.pose.pose.position", "pose.pose.pose.orientation"),
        [f"tag_{i}" for i in seen.column("id", np.int64)],
        seen.fixed("pose.pose.covariance", 36),
    )


def _aruco_array(messages: Messages) -> Decoded:
    seen, rows = messages.children("markers")
    return _aruco(seen, rows, *_headers(messages, seen, rows))


def _aruco_marker(messages: Messages) -> Decoded:
    return _aruco(messages, messages.every, messages.frames(), messages.stamps())


def _aruco(
    seen: Messages, rows: NDArray[np.int64], frames: NDArray[np.object_], stamps: Times
) -> Decoded:
    """aruco_msgs; aruco_ros gives every marker a confidence of 1."""
    return tag_rows(
        frames,
        stamps,
        rows,
        pose_of(seen, "pose.pose.position", "pose.pose.orientation"),
        [f"tag_{i}" for i in seen.column("id", np.int64)],
        seen.fixed("pose.covariance", 36),
        [(seen.column("confidence") <= 0.0, "of no confidence, says the detector")],
    )


def _aruco_lists(messages: Messages) -> Decoded:
    """ros2_aruco and its like: ids and poses in two lists."""
    ids = messages.ragged("marker_ids", np.int64)
    seen, rows = messages.children("poses")
    place = np.arange(len(rows)) - np.searchsorted(rows, rows)
    paired = place < ids.lengths[rows]
    names = np.full(len(rows), "", dtype=object)
    names[paired] = [f"tag_{i}" for i in ids.values[(ids.offsets[:-1][rows] + place)[paired]]]
    decoded = tag_rows(
        messages.frames()[rows],
        messages.stamps()[rows],
        rows,
        pose_of(seen, "position", "orientation"),
        list(names),
        refused=[(~paired, "a pose without an id")],
    )
    alone = len(ids.values) - int(paired.sum())
    more = Remark("skipped", alone, "an id without a pose")
    return Decoded(decoded.columns, decoded.rows, decoded.t_sensor_ns, (*decoded.remarks, more))


def _alvar(messages: Messages) -> Decoded:
    """ar_track_alvar, which never fills its `confidence`."""
    seen, rows = messages.children("markers")
    return tag_rows(
        *_headers(messages, seen, rows),
        rows,
        pose_of(seen, "pose.pose.position", "pose.pose.orientation"),
        [f"tag_{i}" for i in seen.column("id", np.int64)],
    )


def _landmarks(messages: Messages) -> Decoded:
    """cartographer_ros_msgs: weights of what is told; reflectors have no orientation."""
    seen, rows = messages.children("landmark")
    path = "tracking_from_landmark_transform"
    covariance = np.full((len(seen), 6, 6), np.nan)
    turned = seen.column("rotation_weight") > 0.0
    covariance[~turned, 3:, 3:] = ANY_ANGLE * np.eye(3)
    return tag_rows(
        messages.frames()[rows],
        messages.stamps()[rows],
        rows,
        pose_of(seen, f"{path}.position", f"{path}.orientation"),
        [f"tag_{int(i)}" if i.isdecimal() else i for i in seen.texts("id")],
        covariance.reshape(-1, 36),
        [(seen.column("translation_weight") <= 0.0, "of no weight, says the detector")],
    )


def _headers(
    messages: Messages, seen: Messages, rows: NDArray[np.int64]
) -> tuple[NDArray[np.object_], Times]:
    frames, stamps = seen.frames(), seen.stamps()
    frames = np.where(frames == "", messages.frames()[rows], frames).astype(object)
    return frames, np.where(stamps == NO_STAMP, messages.stamps()[rows], stamps)


ISAAC_DETECTIONS = Decoder("references", _isaac)
ARUCO_MARKERS = Decoder("references", _aruco_array)
ARUCO_MARKER = Decoder("references", _aruco_marker)
ARUCO_LISTS = Decoder("references", _aruco_lists)
ALVAR_MARKERS = Decoder("references", _alvar)
LANDMARKS = Decoder("references", _landmarks)
