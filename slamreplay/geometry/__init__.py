"""Frames, rotations, covariances and time: the only place where conventions are converted.

- `T_a_b` maps b-coordinates into a, so that inner letters cancel: `T_a_c = T_a_b @ T_b_c`.
- Planar poses are `xyyaw` arrays (..., 3): x and y in metres in the parent frame, yaw in radians.
- Quaternions are `_xyzw`. Times are int64 nanoseconds with the suffix `_ns`.
- ROS covariances are 6x6 in the order x y z rx ry rz about the parent's axes; gtsam's Pose3 puts
  rotation first and perturbs about the body's axes. Only `covariance` converts between them.
"""
