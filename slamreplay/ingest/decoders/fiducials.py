"""Tags as a camera saw them: fiducial_msgs/FiducialTransformArray, apriltag_ros detections.

One row for each tag seen: the tag (`child_frame_id`, "tag_7") in the camera's frame. The detectors
of ROS 2 that publish no pose in their message publish it on tf; see `slamreplay.ingest.sightings`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.ingest.decoders.checks import kept, pose_rows
from slamreplay.ingest.decoders.decoder import Decoded, Decoder, Messages, Remark


def _sightings(
    messages: Messages,
    seen: Messages,
    rows: NDArray[np.int64],
    paths: tuple[str, str],
    names: list[str],
    covariance: NDArray[np.float64],
    remarks: tuple[Remark, ...] = (),
) -> Decoded:
    position = seen.columns(paths[0], "xyz")
    orientation, keep, found = pose_rows(position, seen.columns(paths[1], "xyzw"))
    columns: dict[str, Any] = {
        "frame_id": messages.frames()[rows],
        "child_frame_id": np.array([*names, ""], dtype=object)[:-1],
        "kind": np.full(len(rows), "fiducial", dtype=object),
        "position_xyz": position,
        "orientation_xyzw": orientation,
        "covariance": covariance,
    }
    return kept(keep, columns, rows, messages.stamps()[rows], (*found, *remarks))


def _transforms(messages: Messages) -> Decoded:
    seen, rows = messages.children("transforms")
    names = [f"tag_{i}" for i in seen.column("fiducial_id", np.int64)]
    paths = ("transform.translation", "transform.rotation")
    return _sightings(messages, seen, rows, paths, names, np.full((len(rows), 36), np.nan))


def _detections(messages: Messages) -> Decoded:
    """apriltag_ros: `int32[] id`, a bundle of tags being one detection of several ids."""
    seen, rows = messages.children("detections")
    ids = seen.ragged("id", np.int64)
    single: NDArray[np.bool_] = ids.lengths == 1
    bundles = Remark("skipped", int((~single).sum()), "a bundle of several tags")
    one = seen.take(single)
    names = [f"tag_{tag}" for tag in one.ragged("id", np.int64).values]
    paths = ("pose.pose.pose.position", "pose.pose.pose.orientation")
    covariance = one.fixed("pose.pose.covariance", 36)
    return _sightings(messages, one, rows[single], paths, names, covariance, (bundles,))


FIDUCIAL_TRANSFORMS = Decoder("references", _transforms)
APRILTAG_DETECTIONS = Decoder("references", _detections)
