"""Layouts of drive commands that no type store has (ros-drivers/ackermann_msgs)."""

from __future__ import annotations

#: Type name ("package/msg/Name") to its fields, one per line.
DRIVES: dict[str, str] = {
    "ackermann_msgs/msg/AckermannDrive": (
        "float32 steering_angle\n"
        "float32 steering_angle_velocity\n"
        "float32 speed\n"
        "float32 acceleration\n"
        "float32 jerk\n"
    ),
    "ackermann_msgs/msg/AckermannDriveStamped": (
        "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n"
    ),
}
