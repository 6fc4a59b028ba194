"""Plain values as ROS messages, of either ROS."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.geometry import se2, se3
from slamreplay.geometry.covariance import ros_from_planar
from slamreplay.geometry.times import NS_PER_S


class Messages:
    """Builds messages with the classes of one type store.

    Args:
        store: a type store of rosbags.
        ros_version: 1 or 2; headers of ROS 1 count messages.
    """

    def __init__(self, store: Any, ros_version: int) -> None:
        self._types = store.types
        self._ros_version = ros_version

    def make(self, msgtype: str, **fields: Any) -> Any:
        """A message of that type ("sensor_msgs/Imu")."""
        package, _, name = msgtype.partition("/")
        return self._types[f"{package}/msg/{name}"](**fields)

    def stamp(self, t_ns: int) -> Any:
        """builtin_interfaces/Time."""
        sec, nanosec = divmod(int(t_ns), NS_PER_S)
        return self.make("builtin_interfaces/Time", sec=sec, nanosec=nanosec)

    def header(self, t_ns: int, frame_id: str) -> Any:
        """std_msgs/Header."""
        seq = {"seq": 0} if self._ros_version == 1 else {}
        return self.make("std_msgs/Header", stamp=self.stamp(t_ns), frame_id=frame_id, **seq)

    def vector(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Any:
        """geometry_msgs/Vector3."""
        return self.make("geometry_msgs/Vector3", x=float(x), y=float(y), z=float(z))

    def quaternion(self, yaw: float) -> Any:
        """geometry_msgs/Quaternion of a heading in rad."""
        z, w = float(np.sin(yaw / 2.0)), float(np.cos(yaw / 2.0))
        return self.make("geometry_msgs/Quaternion", x=0.0, y=0.0, z=z, w=w)

    def pose(self, xyyaw: se2.Array) -> Any:
        """geometry_msgs/Pose."""
        x, y, yaw = (float(v) for v in xyyaw)
        point = self.make("geometry_msgs/Point", x=x, y=y, z=0.0)
        return self.make("geometry_msgs/Pose", position=point, orientation=self.quaternion(yaw))

    def pose_with_covariance(self, xyyaw: se2.Array, cov: se2.Array) -> Any:
        """geometry_msgs/PoseWithCovariance of a planar pose and its (3, 3) covariance."""
        return self.make(
            "geometry_msgs/PoseWithCovariance",
            pose=self.pose(xyyaw),
            covariance=ros_from_planar(cov),
        )

    def twist(self, v: float, w: float) -> Any:
        """geometry_msgs/Twist."""
        return self.make("geometry_msgs/Twist", linear=self.vector(x=v), angular=self.vector(z=w))

    def odometry(
        self,
        t_ns: int,
        frames: tuple[str, str],
        xyyaw: se2.Array,
        cov: se2.Array,
        twist: se2.Array,
        twist_cov: se2.Array,
    ) -> Any:
        """nav_msgs/Odometry; `frames` are parent and child, `twist` is m/s and rad/s."""
        speed = self.make(
            "geometry_msgs/TwistWithCovariance",
            twist=self.twist(*(float(v) for v in twist)),
            covariance=ros_from_planar(twist_cov),
        )
        return self.make(
            "nav_msgs/Odometry",
            header=self.header(t_ns, frames[0]),
            child_frame_id=frames[1],
            pose=self.pose_with_covariance(xyyaw, cov),
            twist=speed,
        )

    def pose_stamped_with_covariance(self, t_ns: int, xyyaw: se2.Array, cov: se2.Array) -> Any:
        """geometry_msgs/PoseWithCovarianceStamped in frame map."""
        return self.make(
            "geometry_msgs/PoseWithCovarianceStamped",
            header=self.header(t_ns, "map"),
            pose=self.pose_with_covariance(xyyaw, cov),
        )

    def transform(
        self, t_ns: int, frames: tuple[str, str], xyyaw: se2.Array, z: float = 0.0
    ) -> Any:
        """tf2_msgs/TFMessage with one transform; `frames` are parent and child."""
        x, y, yaw = (float(v) for v in xyyaw)
        motion = self.make(
            "geometry_msgs/Transform",
            translation=self.vector(x, y, z),
            rotation=self.quaternion(yaw),
        )
        stamped = self.make(
            "geometry_msgs/TransformStamped",
            header=self.header(t_ns, frames[0]),
            child_frame_id=frames[1],
            transform=motion,
        )
        return self.make("tf2_msgs/TFMessage", transforms=[stamped])

    def spatial_transforms(
        self, t_ns: int, parent: str, children: Sequence[str], T: se2.Array
    ) -> Any:
        """tf2_msgs/TFMessage with the poses T (N, 4, 4) of N frames in their parent."""
        found = [
            self.make(
                "geometry_msgs/TransformStamped",
                header=self.header(t_ns, parent),
                child_frame_id=child,
                transform=self.make(
                    "geometry_msgs/Transform",
                    translation=self.vector(*pose[:3, 3]),
                    rotation=self.rotation(pose),
                ),
            )
            for child, pose in zip(children, T, strict=True)
        ]
        return self.make("tf2_msgs/TFMessage", transforms=found)

    def rotation(self, T: se2.Array) -> Any:
        """geometry_msgs/Quaternion of a pose (4, 4)."""
        x, y, z, w = (float(v) for v in se3.quaternion(T[:3, :3]))
        return self.make("geometry_msgs/Quaternion", x=x, y=y, z=z, w=w)

    def code(self, t_ns: int, camera: str, number: int, size_m: float, T: se2.Array) -> Any:
        """apriltag_ros/AprilTagDetection of a pose (4, 4) in the camera; no covariance is told."""
        x, y, z = (float(v) for v in T[:3, 3])
        pose = self.make(
            "geometry_msgs/Pose",
            position=self.make("geometry_msgs/Point", x=x, y=y, z=z),
            orientation=self.rotation(T),
        )
        stamped = self.make(
            "geometry_msgs/PoseWithCovarianceStamped",
            header=self.header(t_ns, camera),
            pose=self.make("geometry_msgs/PoseWithCovariance", pose=pose, covariance=np.zeros(36)),
        )
        return self.make(
            "apriltag_ros/AprilTagDetection",
            id=np.array([number], dtype=np.int32),
            size=np.array([size_m]),
            pose=stamped,
        )

    def grid(
        self,
        t_ns: int,
        frame_id: str,
        cells: NDArray[np.int8],
        resolution_m: float,
        origin_xyyaw: se2.Array,
    ) -> Any:
        """nav_msgs/OccupancyGrid of cells (H, W), row 0 at the bottom."""
        info = self.make(
            "nav_msgs/MapMetaData",
            map_load_time=self.stamp(t_ns),
            resolution=float(resolution_m),
            width=cells.shape[1],
            height=cells.shape[0],
            origin=self.pose(origin_xyyaw),
        )
        return self.make(
            "nav_msgs/OccupancyGrid",
            header=self.header(t_ns, frame_id),
            info=info,
            data=np.ascontiguousarray(cells, dtype=np.int8).ravel(),
        )

    def path(self, t_ns: int, xyyaw: se2.Array) -> Any:
        """nav_msgs/Path of poses (N, 3) in frame map."""
        poses = [
            self.make(
                "geometry_msgs/PoseStamped", header=self.header(t_ns, "map"), pose=self.pose(p)
            )
            for p in xyyaw
        ]
        return self.make("nav_msgs/Path", header=self.header(t_ns, "map"), poses=poses)
