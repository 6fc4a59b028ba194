"""Perturbations: one named change to the evidence with one level."""

from slamreplay.registry import Registry

_HERE = "slamreplay.perturb"

PERTURBATIONS = Registry(
    "perturbation",
    {
        "beam_drop": f"{_HERE}.beam_drop:BeamDrop",
        "clock_skew": f"{_HERE}.clock_skew:ClockSkew",
        "frame_swap": f"{_HERE}.frame_swap:FrameSwap",
        "gyro_bias": f"{_HERE}.gyro_bias:GyroBias",
        "handedness": f"{_HERE}.handedness:Handedness",
        "imu_drop": f"{_HERE}.imu_drop:ImuDrop",
        "initial_pose": f"{_HERE}.initial_pose:InitialPose",
        "laser_extrinsic": f"{_HERE}.laser_extrinsic:LaserExtrinsic",
        "map_edit": f"{_HERE}.map_edit:MapEdit",
        "map_rotate": f"{_HERE}.map_rotate:MapRotate",
        "map_shift": f"{_HERE}.map_shift:MapShift",
        "map_stale": f"{_HERE}.map_stale:MapStale",
        "max_range": f"{_HERE}.max_range:MaxRange",
        "measurement_noise_scale": f"{_HERE}.measurement_noise_scale:MeasurementNoiseScale",
        "min_score": f"{_HERE}.min_score:MinScore",
        "odometry_drop": f"{_HERE}.odometry_drop:OdometryDrop",
        "odometry_noise": f"{_HERE}.odometry_noise:OdometryNoise",
        "odometry_scale": f"{_HERE}.odometry_scale:OdometryScale",
        "odometry_slip": f"{_HERE}.odometry_slip:OdometrySlip",
        "particle_count": f"{_HERE}.particle_count:ParticleCount",
        "people": f"{_HERE}.people:People",
        "pose_covariance_scale": f"{_HERE}.pose_covariance_scale:PoseCovarianceScale",
        "process_noise_scale": f"{_HERE}.process_noise_scale:ProcessNoiseScale",
        "quaternion_order": f"{_HERE}.quaternion_order:QuaternionOrder",
        "range_bias": f"{_HERE}.range_bias:RangeBias",
        "range_noise": f"{_HERE}.range_noise:RangeNoise",
        "scan_delay": f"{_HERE}.scan_delay:ScanDelay",
        "scan_drop": f"{_HERE}.scan_drop:ScanDrop",
        "stamp_jitter": f"{_HERE}.stamp_jitter:StampJitter",
        "tf_delay": f"{_HERE}.tf_delay:TfDelay",
        "unit_error": f"{_HERE}.unit_error:UnitError",
    },
)
