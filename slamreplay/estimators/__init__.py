"""Estimators: where an algorithm, given the evidence of a bundle, thinks the robot was."""

from slamreplay.registry import Registry

ESTIMATORS = Registry(
    "estimator",
    {
        "amcl": "slamreplay.estimators.amcl.estimator:Amcl",
        "dead_reckoning": "slamreplay.estimators.dead_reckoning:DeadReckoning",
        "ekf": "slamreplay.estimators.ekf.estimator:Ekf",
        "ekf_tuned": "slamreplay.estimators.ekf.estimator:EkfTuned",
    },
)
