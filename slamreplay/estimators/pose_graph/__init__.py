"""SLAM by a pose graph: submaps, loop closures by branch and bound, GTSAM."""
