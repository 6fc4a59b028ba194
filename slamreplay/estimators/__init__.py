"""Estimators: where an algorithm, given the evidence of a bundle, thinks the robot was."""

from slamreplay.registry import Registry

ESTIMATORS = Registry(
    "estimator",
    {
        "amcl": "slamreplay.estimators.amcl.estimator:Amcl",
        "dead_reckoning": "slamreplay.estimators.dead_reckoning:DeadReckoning",
        "ekf": "slamreplay.estimators.ekf.estimator:Ekf",
        "ekf_tuned": "slamreplay.estimators.ekf.estimator:EkfTuned",
        "pose_graph": "slamreplay.estimators.pose_graph.estimator:PoseGraph",
        "pose_graph_online": "slamreplay.estimators.pose_graph.estimator:PoseGraphOnline",
        "fiducial_grid": "slamreplay.estimators.fiducial_grid.estimator:FiducialGrid",
        "recorded": "slamreplay.estimators.recorded:Recorded",
        "recorded_pose": "slamreplay.estimators.recorded:RecordedPose",
        "recorded_tf": "slamreplay.estimators.recorded:RecordedTf",
        "scan_matching": "slamreplay.estimators.scan_matching.estimator:ScanMatching",
    },
)

#: What the log's own localizer said: never run again, and judged already as the robot's belief.
RECORDED = ("recorded", "recorded_pose", "recorded_tf")
