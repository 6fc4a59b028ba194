"""Perturbations: one named change to the evidence with one level."""

from slamreplay.registry import Registry
from slamreplay.stage import callable_stage

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

#: Variants of each, for the shell's completion, which has no time to load them.
VARIANTS: dict[str, tuple[str, ...]] = {
    "beam_drop": ("random", "field_of_view", "sector"),
    "clock_skew": ("laser", "odometry"),
    "frame_swap": ("odometry", "laser", "scan_in_base"),
    "gyro_bias": ("yaw",),
    "handedness": ("odometry", "odometry_y", "odometry_yaw", "scan_order", "imu_yaw", "map_rows"),
    "imu_drop": ("random", "burst"),
    "initial_pose": ("offset", "aside", "rotate", "ambiguous", "global"),
    "laser_extrinsic": ("x", "y", "yaw"),
    "map_edit": ("appeared", "removed", "moved"),
    "map_rotate": ("centre",),
    "map_shift": ("x", "y"),
    "map_stale": ("versions", "age"),
    "max_range": ("share", "limit"),
    "measurement_noise_scale": ("covariance",),
    "min_score": ("scale",),
    "odometry_drop": ("random", "burst"),
    "odometry_noise": ("distance", "heading"),
    "odometry_scale": ("translation", "rotation"),
    "odometry_slip": ("window", "turn", "per_turn"),
    "particle_count": ("scale",),
    "people": ("hidden",),
    "pose_covariance_scale": ("covariance",),
    "process_noise_scale": ("covariance",),
    "quaternion_order": ("odometry", "tf", "initial_pose", "imu"),
    "range_bias": ("offset", "scale"),
    "range_noise": ("gaussian", "proportional"),
    "scan_delay": ("stamp",),
    "scan_drop": ("random", "burst", "even", "nth"),
    "stamp_jitter": ("scans", "odometry"),
    "tf_delay": ("odometry", "all"),
    "unit_error": (
        "odometry_deg_as_rad",
        "odometry_rad_as_deg",
        "odometry_mm_as_m",
        "imu_deg_as_rad",
        "imu_rad_as_deg",
        "scan_mm_as_m",
        "start_deg_as_rad",
    ),
}

callable_stage(__name__)
