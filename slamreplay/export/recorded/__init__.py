"""The evidence of a bundle as an ordinary ROS 2 log: the least that a log for somebody else needs.

Topics, types, header stamps and log times are those of the log, where the bundle's tables allow it;
what they do not allow is counted. Logs of ROS 1 and text logs become ROS 2 on the way.
"""
