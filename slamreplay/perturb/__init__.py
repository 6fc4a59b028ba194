"""Perturbations: one named change to the evidence with one level."""

from slamreplay.registry import Registry

_HERE = "slamreplay.perturb"

PERTURBATIONS = Registry(
    "perturbation",
    {
        "initial_pose": f"{_HERE}.initial_pose:InitialPose",
        "odometry_scale": f"{_HERE}.odometry_scale:OdometryScale",
        "scan_delay": f"{_HERE}.scan_delay:ScanDelay",
        "scan_drop": f"{_HERE}.scan_drop:ScanDrop",
        "tf_delay": f"{_HERE}.tf_delay:TfDelay",
    },
)
