"""The messages of one topic on their way into a log, and how values become ROS messages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Table
from slamreplay.export.formats import NotAsRecorded
from slamreplay.geometry import se3
from slamreplay.geometry.times import NO_STAMP, NS_PER_S, Times
from slamreplay.simulate.messages import Messages

#: Stamps of ROS 2 hold seconds as int32.
_LAST_S = np.iinfo(np.int32).max


@dataclass(frozen=True, eq=False)
class Stream:
    """Messages of one topic.

    Attributes:
        topic: its name.
        msgtype: "package/Name".
        t_log_ns: (M,) log times, ascending.
        message: the message of each.
        latched: whether late subscribers get the last one.
    """

    topic: str
    msgtype: str
    t_log_ns: Times
    message: Callable[[int], Any]
    latched: bool = False


@dataclass(frozen=True, eq=False)
class Encoded:
    """What became of some tables: streams, and what could not be told."""

    streams: Sequence[Stream]
    not_as_recorded: Sequence[NotAsRecorded] = ()


class Composer(Messages):
    """Messages of rows: in space, with stamps that may be missing."""

    def pose_of(self, position: Sequence[float], orientation: Sequence[float]) -> Any:
        """geometry_msgs/Pose of x y z and a quaternion xyzw."""
        point = self.make("geometry_msgs/Point", **_named("xyz", position))
        turn = self.make("geometry_msgs/Quaternion", **_named("xyzw", orientation))
        return self.make("geometry_msgs/Pose", position=point, orientation=turn)

    def pose_with_covariance_of(
        self, position: Sequence[float], orientation: Sequence[float], covariance: NDArray
    ) -> Any:
        """geometry_msgs/PoseWithCovariance of the same and a covariance (36,), as ROS has it."""
        pose = self.pose_of(position, orientation)
        return self.make("geometry_msgs/PoseWithCovariance", pose=pose, covariance=covariance)

    def twist_with_covariance_of(
        self, linear: Sequence[float], angular: Sequence[float], covariance: NDArray
    ) -> Any:
        """geometry_msgs/TwistWithCovariance of velocities and a covariance (36,), as ROS has it."""
        twist = self.twist_of(linear, angular)
        return self.make("geometry_msgs/TwistWithCovariance", twist=twist, covariance=covariance)

    def planar(self, xyyaw: NDArray[np.float64]) -> list[Any]:
        """geometry_msgs/Pose of each of (N, 3) planar poses."""
        turns = se3.quaternion_from_yaw(xyyaw[:, 2]).tolist()
        places = xyyaw[:, :2].tolist()
        return [self.pose_of((x, y, 0.0), q) for (x, y), q in zip(places, turns, strict=True)]

    def vector_of(self, xyz: Sequence[float]) -> Any:
        """geometry_msgs/Vector3."""
        return self.make("geometry_msgs/Vector3", **_named("xyz", xyz))

    def twist_of(self, linear: Sequence[float], angular: Sequence[float]) -> Any:
        """geometry_msgs/Twist."""
        return self.make(
            "geometry_msgs/Twist", linear=self.vector_of(linear), angular=self.vector_of(angular)
        )


def header_stamps(table: Table) -> list[int]:
    """Header stamps of the rows, ns; 0 where there is none that ROS 2 can hold."""
    t_ns = table["t_sensor_ns"]
    usable = (t_ns != NO_STAMP) & (t_ns >= 0) & (t_ns // NS_PER_S <= _LAST_S)
    return np.where(usable, t_ns, 0).tolist()


def given(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariances (N, K) with zeros, ROS's word for unknown, in rows that hold none."""
    return np.where(np.isnan(covariance).all(axis=1, keepdims=True), 0.0, covariance)


def groups(t_log_ns: Times, *keys: Sequence[Any]) -> list[NDArray[np.int64]]:
    """Rows that follow each other with one log time and the same keys: those of one message."""
    if not len(t_log_ns):
        return []
    new = np.append(True, t_log_ns[1:] != t_log_ns[:-1])
    for key in keys:
        column = np.asarray(key)
        new |= np.append(True, column[1:] != column[:-1])
    return np.split(np.arange(len(t_log_ns)), np.flatnonzero(new)[1:])


def _named(letters: str, values: Sequence[float]) -> dict[str, float]:
    return {name: float(v) for name, v in zip(letters, values, strict=True)}
