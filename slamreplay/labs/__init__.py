"""Laboratories: questions about estimators that a simulation answers, with no log at hand.

A lab is one file or folder here (a model whose fields are what a recipe sets, and `run`), one line
below, one figure in `slamreplay.report.figures` and one folder under `recipes/`.
"""

from slamreplay.registry import Registry

LABS = Registry(
    "lab",
    {
        "covariance_breathing": "slamreplay.labs.covariance_breathing.lab:CovarianceBreathing",
        "covariance_collapse": "slamreplay.labs.covariance_collapse.lab:CovarianceCollapse",
        "false_closures": "slamreplay.labs.false_closures.lab:FalseClosures",
        "interval_calibration": "slamreplay.labs.interval_calibration.lab:IntervalCalibration",
        "joint_estimation": "slamreplay.labs.joint_estimation.lab:JointEstimation",
        "lost_or_changed": "slamreplay.labs.lost_or_changed.lab:LostOrChanged",
        "minimum_replay": "slamreplay.labs.minimum_replay.lab:MinimumReplay",
        "two_run": "slamreplay.labs.two_run.lab:TwoRun",
        "units_and_handedness": "slamreplay.labs.units_and_handedness.lab:UnitsAndHandedness",
        "wheel_slip": "slamreplay.labs.wheel_slip.lab:WheelSlip",
    },
)
