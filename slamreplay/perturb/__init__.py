"""Perturbations: one named change to the evidence with one level."""

from slamreplay.registry import Registry

_HERE = "slamreplay.perturb"

PERTURBATIONS = Registry(
    "perturbation",
    {
        "frame_swap": f"{_HERE}.frame_swap:FrameSwap",
        "gyro_bias": f"{_HERE}.gyro_bias:GyroBias",
        "handedness": f"{_HERE}.handedness:Handedness",
        "imu_drop": f"{_HERE}.imu_drop:ImuDrop",
        "initial_pose": f"{_HERE}.initial_pose:InitialPose",
        "measurement_noise_scale": f"{_HERE}.measurement_noise_scale:MeasurementNoiseScale",
        "min_score": f"{_HERE}.min_score:MinScore",
        "odometry_drop": f"{_HERE}.odometry_drop:OdometryDrop",
        "odometry_noise": f"{_HERE}.odometry_noise:OdometryNoise",
        "odometry_scale": f"{_HERE}.odometry_scale:OdometryScale",
        "odometry_slip": f"{_HERE}.odometry_slip:OdometrySlip",
        "particle_count": f"{_HERE}.particle_count:ParticleCount",
        "pose_covariance_scale": f"{_HERE}.pose_covariance_scale:PoseCovarianceScale",
        "process_noise_scale": f"{_HERE}.process_noise_scale:ProcessNoiseScale",
        "quaternion_order": f"{_HERE}.quaternion_order:QuaternionOrder",
        "scan_delay": f"{_HERE}.scan_delay:ScanDelay",
        "scan_drop": f"{_HERE}.scan_drop:ScanDrop",
        "tf_delay": f"{_HERE}.tf_delay:TfDelay",
        "unit_error": f"{_HERE}.unit_error:UnitError",
    },
)
