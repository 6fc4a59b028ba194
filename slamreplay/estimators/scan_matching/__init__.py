"""Local SLAM: each scan laid onto a map of the scans before it."""
