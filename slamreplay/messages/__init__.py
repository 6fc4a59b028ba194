"""Message definitions that neither ROS 1 nor ROS 2 type stores carry: one place for all readers."""
