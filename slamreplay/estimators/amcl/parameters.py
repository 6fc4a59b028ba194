"""AMCL's parameters by the names that nav2_amcl and ROS 1's amcl give them.

Sources: nav2_amcl's configuration page (docs.nav2.org/configuration/packages/configuring-amcl.html)
and amcl_node.cpp; wiki.ros.org/amcl and ROS 1's amcl_node.cpp, whose defaults are others, and
amcl_odom.cpp, whose `omni` models give alpha1 and alpha4 each other's part.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from math import pi

from slamreplay.errors import UsageError
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.estimators.parameters import settings_from, unknown_parameter

#: What nav2_amcl calls otherwise than AmclConfig does.
_NAV2 = {
    "initial_pose.x": "initial_pose_x",
    "initial_pose.y": "initial_pose_y",
    "initial_pose.yaw": "initial_pose_yaw",
}
_ROBOT_MODELS = {
    "differential": "differential",
    "nav2_amcl::DifferentialMotionModel": "differential",
    "omnidirectional": "omnidirectional",
    "nav2_amcl::OmniMotionModel": "omnidirectional",
}
#: What only ROS 1's amcl has, or calls so.
_ROS_1 = {
    "kld_err": "pf_err",
    "kld_z": "pf_z",
    "laser_max_beams": "max_beams",
    "initial_pose_a": "initial_pose_yaw",
    "initial_cov_xx": "initial_cov_xx",
    "initial_cov_yy": "initial_cov_yy",
    "initial_cov_aa": "initial_cov_aa",
    "initial_pose_x": "initial_pose_x",
    "initial_pose_y": "initial_pose_y",
    **{f"odom_alpha{k}": f"alpha{k}" for k in range(1, 6)},
    **{f"laser_{n}": n for n in ("z_hit", "z_short", "z_max", "z_rand")},
    **{f"laser_{n}": n for n in ("sigma_hit", "lambda_short")},
}
#: Motion model, and whether its noise is squared.
_ODOM_MODELS = {
    "diff": ("differential", True),
    "diff-corrected": ("differential", False),
    "omni": ("omnidirectional", True),
    "omni-corrected": ("omnidirectional", False),
}
#: Where ROS 1's defaults are others than nav2_amcl's.
_ROS_1_DEFAULTS = AmclConfig(
    squared_motion_noise=True,
    z_hit=0.95,
    z_short=0.1,
    z_rand=0.05,
    laser_max_range=-1.0,
    max_beams=30,
    min_particles=100,
    max_particles=5000,
    update_min_d=0.2,
    update_min_a=pi / 6.0,
    resample_interval=2,
    pf_err=0.01,
    recovery_alpha_slow=0.001,
    recovery_alpha_fast=0.1,
)

#: Of the live node alone: names of frames and topics, what is sent when, and how maps come in.
LIVE = (
    "base_frame_id",
    "global_frame_id",
    "odom_frame_id",
    "scan_topic",
    "map_topic",
    "tf_broadcast",
    "transform_tolerance",
    "save_pose_rate",
    "gui_publish_rate",
    "use_map_topic",
    "first_map_only",
    "first_map_only_",
    "always_reset_initial_pose",
    "initial_pose.z",
    "freespace_downsampling",
    "bag_scan_period",
    "restore_defaults",
    "force_update_after_initialpose",
    "force_update_after_set_map",
    "std_warn_level_*",
)

_OURS = frozenset({"motion_model", "squared_motion_noise", "know_initial_pose"})
NAMES = frozenset(
    ({f.name for f in fields(AmclConfig)} - _OURS)
    | set(_NAV2)
    | set(_ROS_1)
    | {"robot_model_type", "odom_model_type"}
)


def config_from(given: Mapping[str, object], where: str = "amcl") -> AmclConfig:
    """The configuration that parameters of either node make.

    A name that only ROS 1 has makes the rest be of ROS 1, too: its defaults hold for what is not
    given, and an initial pose is where it starts if the log says of none.

    Raises:
        UsageError: a name that neither node has, one that is given twice in two spellings, or a
            value that makes no sense.
    """
    is_ros_1 = "odom_model_type" in given or any(name in _ROS_1 for name in given)
    values: dict[str, object] = {}
    for name, value in given.items():
        if name not in NAMES:
            raise unknown_parameter(name, tuple(NAMES), where)
        if name == "robot_model_type":
            values["motion_model"] = _model(name, value, _ROBOT_MODELS, where)
            continue
        if name == "odom_model_type":
            kind, squared = _model(name, value, _ODOM_MODELS, where)
            values |= {"motion_model": kind, "squared_motion_noise": squared}
            continue
        ours = _NAV2.get(name, _ROS_1.get(name, name))
        if ours in values:
            raise UsageError(f"'{ours}' is given twice, once as '{name}'", where=where)
        values[ours] = value
    if not is_ros_1:
        return settings_from(AmclConfig, values, where=where, known=tuple(NAMES))
    defaults = {f.name: getattr(_ROS_1_DEFAULTS, f.name) for f in fields(AmclConfig)}
    if any(name.startswith("initial_pose_") for name in values):
        defaults["know_initial_pose"] = True
    config = settings_from(AmclConfig, {**defaults, **values}, where=where, known=tuple(NAMES))
    if config.motion_model == "omnidirectional":
        return replace(config, alpha1=config.alpha4, alpha4=config.alpha1)
    return config


def _model(name: str, value: object, models: Mapping[str, object], where: str):  # type: ignore[no-untyped-def]
    """What a model's name stands for."""
    if not isinstance(value, str) or value not in models:
        shown = repr(value)[:40]
        raise UsageError(
            f"'{name}' is {shown}: it should be one of {', '.join(models)}", where=where
        )
    return models[value]
