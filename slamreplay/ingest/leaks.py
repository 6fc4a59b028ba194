"""References in disguise: a transform that only repeats what a judging reference says.

A motion-capture or reflector system may publish its pose as a topic and, over tf, as the frame
`map` too. Taken for the localizer's, it would judge itself and find no error at all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2, se3
from slamreplay.geometry.times import NO_STAMP, Times
from slamreplay.ingest.rows import TopicRows

#: Far below what any two independent systems agree to, far above rounding.
_SAME_M, _SAME_RAD = 1e-4, 1e-4


def repeated_reference(
    frame: str, odom: str, base: str, tf: Sequence[TopicRows], references: Sequence[TopicRows]
) -> str | None:
    """The reference topic whose poses tf repeats between `frame` and `base`, or None.

    Args:
        frame: a frame beside odom that might be the map.
        odom: frame the base moves in.
        base: the robot's base.
        tf: rows of table transforms.
        references: topics that are named as references.
    """
    correction, carried = _planar(tf, odom, frame), _planar(tf, odom, base)
    if correction is None or carried is None:
        return None
    for topic in references:
        rows = np.flatnonzero(np.isin(topic.t_sensor_ns, correction[0]))
        if topic.frame() != frame or len(rows) < 10:
            continue
        at = topic.t_sensor_ns[rows]
        T_odom_frame = se2.interpolate(*correction, at)
        T_frame_base = se2.between(T_odom_frame, se2.interpolate(*carried, at))
        yaw = se3.yaw_from_quaternion(topic.columns["orientation_xyzw"][rows])
        said = np.column_stack([topic.columns["position_xyz"][rows, :2], yaw])
        apart = se2.between(said, T_frame_base)
        same = (np.hypot(apart[:, 0], apart[:, 1]) < _SAME_M) & (np.abs(apart[:, 2]) < _SAME_RAD)
        if same.mean() > 0.9:
            return topic.topic
    return None


def _planar(
    tf: Sequence[TopicRows], parent: str, child: str
) -> tuple[Times, NDArray[np.float64]] | None:
    """Stamps and T_parent_child of the pair, whichever way round tf has it; None without rows."""
    for up, down in ((parent, child), (child, parent)):
        times, poses = [], []
        for topic in tf:
            rows = np.flatnonzero(
                (topic.columns["parent_frame"] == up)
                & (topic.columns["child_frame"] == down)
                & (topic.t_sensor_ns != NO_STAMP)
            )
            columns = topic.columns
            T = se3.matrix(columns["translation_xyz"][rows], columns["rotation_xyzw"][rows])
            times.append(topic.t_sensor_ns[rows])
            poses.append(se3.planar(T))
        t = np.concatenate(times) if times else np.empty(0, dtype=np.int64)
        if len(t):
            xyyaw = np.concatenate(poses)
            order = np.argsort(t, kind="stable")
            xyyaw = xyyaw if up == parent else se2.inverse(xyyaw)
            return t[order], xyyaw[order]
    return None
