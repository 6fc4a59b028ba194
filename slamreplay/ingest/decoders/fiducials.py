"""Tags as a camera saw them: fiducial_msgs/FiducialTransformArray, apriltag_ros detections.

One row for each tag seen: the tag (`child_frame_id`, "tag_7") in the camera's frame. The detectors
of ROS 2 that publish no pose in their message publish it on tf; see `slamreplay.ingest.sightings`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry.times import Times
from slamreplay.ingest.decoders.checks import kept, pose_rows
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark


def tag_rows(
    frames: NDArray[np.object_],
    t_sensor_ns: Times,
    rows: NDArray[np.int64],
    pose: tuple[NDArray[np.float64], NDArray[np.float64]],
    names: Sequence[str],
    covariance: NDArray[np.float64] | None = None,
    refused: Sequence[tuple[NDArray[np.bool_], str]] = (),
) -> Decoded:
    """Rows of table references, of kind fiducial.

    Args:
        frames: (M,) the frame each of M tags was seen in.
        t_sensor_ns: (M,) when.
        rows: (M,) the message each came from.
        pose: positions (M, 3) in m and quaternions (M, 4) xyzw.
        names: M names of the tags' frames.
        covariance: (M, 36) of the pose; None where there is none.
        refused: masks (M,) of detections that the detector itself does not stand by, with reasons.
    """
    position, raw = pose
    # A tag cannot sit in the camera: detectors write zeros where they found no pose.
    nowhere = ((position == 0.0).all(axis=1), "its position is all zeros: no pose was found")
    remarks, use = [], np.ones(len(rows), dtype=bool)
    for mask, reason in (*refused, nowhere):
        remarks.append(Remark("skipped", int((use & mask).sum()), reason))
        use = use & ~mask
    index = np.flatnonzero(use)
    orientation, keep, found = pose_rows(position[index], raw[index])
    columns: dict[str, Any] = {
        "frame_id": frames[index],
        "child_frame_id": np.array([*names, ""], dtype=object)[:-1][index],
        "kind": np.full(len(index), "fiducial", dtype=object),
        "position_xyz": position[index],
        "orientation_xyzw": orientation,
        "covariance": np.full((len(rows), 36), np.nan)[index]
        if covariance is None
        else covariance[index],
    }
    return kept(keep, columns, rows[index], t_sensor_ns[index], (*found, *remarks))


def pose_of(
    seen: Messages, position: str, orientation: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions (M, 3) and quaternions (M, 4) xyzw at two paths."""
    return seen.columns(position, "xyz"), seen.columns(orientation, "xyzw")


def _transforms(messages: Messages) -> Decoded:
    """fiducial_msgs, whose newer layout also lists tags that were looked for and not found."""
    seen, rows = messages.children("transforms")
    refused = []
    if seen.has("detected"):
        refused.append((~seen.column("detected", bool), "not detected, says the detector"))
    return tag_rows(
        messages.frames()[rows],
        messages.stamps()[rows],
        rows,
        pose_of(seen, "transform.translation", "transform.rotation"),
        [f"tag_{i}" for i in seen.column("fiducial_id", np.int64)],
        refused=refused,
    )


def _detections(messages: Messages) -> Decoded:
    """apriltag_ros: `int32[] id`, a bundle of tags being one detection of several ids."""
    seen, rows = messages.children("detections")
    ids = seen.ragged("id", np.int64)
    single = ids.lengths == 1
    names = np.full(len(seen), "", dtype=object)
    names[single] = [f"tag_{tag}" for tag in ids.values[ids.offsets[:-1][single]]]
    return tag_rows(
        messages.frames()[rows],
        messages.stamps()[rows],
        rows,
        pose_of(seen, "pose.pose.pose.position", "pose.pose.pose.orientation"),
        list(names),
        seen.fixed("pose.pose.covariance", 36),
        [(~single, "a bundle of several tags")],
    )


FIDUCIAL_TRANSFORMS = Decoder("references", _transforms)
APRILTAG_DETECTIONS = Decoder("references", _detections)
