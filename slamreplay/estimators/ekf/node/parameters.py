"""Parameters of an `ekf_node` by robot_localization's names, checked."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from slamreplay.errors import UsageError
from slamreplay.estimators.parameters import unknown_parameter
from slamreplay.geometry import se2
from slamreplay.geometry.transforms import clean_frame

#: Places of x y yaw, vx vy vyaw, ax ay among the fifteen of a `_config`.
PLANAR = np.array([0, 1, 5, 6, 7, 11, 12, 13])
_SIZE = 15
#: Diagonal of the process noise unless it is given (FilterBase::reset), per second.
_PROCESS_NOISE = (0.05, 0.05, 0.06, 0.03, 0.03, 0.06, 0.025, 0.025, 0.04, 0.01, 0.01, 0.02, 0.01,
                  0.01, 0.015)  # fmt: skip
_INITIAL_VARIANCE = 1e-9
_INPUT = re.compile(r"(odom|pose|twist|imu)(\d+)(?:_(\w+))?")
#: What may follow the name of an input, by its kind.
_OF_INPUT = {
    "odom": ("config", "differential", "relative", "pose_rejection_threshold",
             "twist_rejection_threshold"),
    "pose": ("config", "differential", "relative", "rejection_threshold"),
    "twist": ("config", "rejection_threshold"),
    "imu": ("config", "differential", "relative", "pose_rejection_threshold",
            "twist_rejection_threshold", "angular_velocity_rejection_threshold",
            "linear_acceleration_rejection_threshold", "remove_gravitational_acceleration"),
}  # fmt: skip
_OF_NODE = ("two_d_mode", "map_frame", "odom_frame", "base_link_frame", "world_frame",
            "process_noise_covariance", "dynamic_process_noise_covariance", "initial_state",
            "initial_estimate_covariance", "gravitational_acceleration")  # fmt: skip
#: Parameters of the live node: how often and where it publishes, queues, lags, debugging; and the
#: control input, which a replay leaves out.
LIVE = (
    "frequency", "sensor_timeout", "print_diagnostics", "publish_tf", "publish_acceleration",
    "debug", "debug_out_file", "transform_time_offset", "transform_timeout", "silent_tf_failure",
    "base_link_frame_output", "smooth_lagged_data", "history_length", "predict_to_current_time",
    "reset_on_time_jump", "permit_corrected_publication", "disabled_at_startup", "tf_prefix",
    "use_control", "stamped_control", "control_timeout", "control_config", "acceleration_limits",
    "acceleration_gains", "deceleration_limits", "deceleration_gains", "diagnostics_updater.*",
    "*_queue_size", "*_nodelay", "*_pose_use_child_frame",
)  # fmt: skip
#: As many inputs of a kind as a file for all nodes may speak of.
_INPUTS = 10
#: Every name that a node knows.
NAMES = frozenset(_OF_NODE) | {
    name
    for kind, parts in _OF_INPUT.items()
    for one in (f"{kind}{number}" for number in range(_INPUTS))
    for name in (one, *(f"{one}_{part}" for part in parts))
}


@dataclass(frozen=True)
class Input:
    """One input of the filter.

    Attributes:
        name: odom0, imu1, ...
        topic: where its messages come from.
        config: which of the fifteen values of a message are taken in: x y z roll pitch yaw and
            their rates, ax ay az.
        differential: poses are taken in as velocities between two of them.
        relative: poses count from the first one.
        pose_threshold: largest Mahalanobis distance of a pose, None for any,
        twist_threshold: of velocities,
        acceleration_threshold: and of accelerations.
        without_gravity: whether gravity is taken off the accelerations.
    """

    name: str
    topic: str
    config: tuple[bool, ...]
    differential: bool = False
    relative: bool = False
    pose_threshold: float | None = None
    twist_threshold: float | None = None
    acceleration_threshold: float | None = None
    without_gravity: bool = False

    @property
    def kind(self) -> str:
        """odom, pose, twist or imu."""
        return self.name.rstrip("0123456789")


@dataclass(frozen=True)
class NodeParameters:
    """What an `ekf_node` is told.

    Attributes:
        inputs: in the order of their names.
        world_frame: in which the pose is estimated.
        map_frame: name of the map frame.
        base_frame: of the robot; None for the one that the log has.
        process_noise: (8 x 8) of x y yaw vx vy vyaw ax ay, per second, row-major.
        scales_with_speed: whether that of the pose grows with the square of the speed.
        initial_state: of these eight.
        initial_covariance: (8 x 8) of it, row-major.
        gravity: m/s^2.
    """

    inputs: tuple[Input, ...]
    world_frame: str
    map_frame: str
    base_frame: str | None
    process_noise: tuple[float, ...]
    scales_with_speed: bool
    initial_state: tuple[float, ...]
    initial_covariance: tuple[float, ...]
    gravity: float


def names_of_inputs(given: Mapping[str, object]) -> list[str]:
    """The inputs that are spoken of: odom0 by `odom0` or `odom0_config`."""
    found = {m[1] + m[2] for m in map(_INPUT.fullmatch, given) if m}
    return sorted(found)


def node_parameters(given: Mapping[str, object]) -> NodeParameters:
    """The parameters of a file, checked.

    Raises:
        UsageError: a parameter that there is not (with the nearest one), a value that it cannot
            have, an input without topic or with nothing to take in.
    """
    inputs = names_of_inputs(given)
    known = {*_OF_NODE}
    for name in inputs:
        kind = name.rstrip("0123456789")
        known |= {name, *(f"{name}_{part}" for part in _OF_INPUT[kind])}
    for key in given:
        if key not in known:
            raise unknown_parameter(key, tuple(known), "ekf")
    odom_frame = _text(given, "odom_frame", "odom")
    base = _text(given, "base_link_frame", "")
    return NodeParameters(
        tuple(_input(given, name) for name in inputs),
        clean_frame(_text(given, "world_frame", odom_frame)),
        clean_frame(_text(given, "map_frame", "map")),
        clean_frame(base) or None,
        _planar_matrix(given, "process_noise_covariance", np.diag(_PROCESS_NOISE)),
        _flag(given, "dynamic_process_noise_covariance"),
        tuple(_numbers(given, "initial_state", (_SIZE,), np.zeros(_SIZE))[PLANAR].tolist()),
        _planar_matrix(given, "initial_estimate_covariance", _INITIAL_VARIANCE * np.eye(_SIZE)),
        _number(given, "gravitational_acceleration", 9.80665),
    )


def _input(given: Mapping[str, object], name: str) -> Input:
    topic = _text(given, name, "")
    if not topic:
        raise UsageError(f"'{name}' names no topic", where="ekf", hint=f"{name}: /topic")
    config = given.get(f"{name}_config")
    flags = list(config) if isinstance(config, list | tuple) else []
    if len(flags) != _SIZE or not all(isinstance(f, bool) for f in flags):
        hint = "x y z roll pitch yaw vx vy vz vroll vpitch vyaw ax ay az"
        raise UsageError(f"'{name}_config' is no list of {_SIZE} booleans", where="ekf", hint=hint)
    kind = name.rstrip("0123456789")
    pose, twist = f"{name}_pose_rejection_threshold", f"{name}_twist_rejection_threshold"
    if kind in ("pose", "twist"):
        pose = twist = f"{name}_rejection_threshold"
    rate = f"{name}_angular_velocity_rejection_threshold"
    differential = _flag(given, f"{name}_differential")
    return Input(
        name,
        topic,
        tuple(flags),
        differential,
        _flag(given, f"{name}_relative") and not differential,  # as the node decides
        _threshold(given, pose),
        _threshold(given, rate if rate in given else twist),
        _threshold(given, f"{name}_linear_acceleration_rejection_threshold"),
        _flag(given, f"{name}_remove_gravitational_acceleration"),
    )


def _flag(given: Mapping[str, object], name: str) -> bool:
    value = given.get(name, False)
    if not isinstance(value, bool):
        raise UsageError(f"'{name}' is {value!r}: it should be true or false", where="ekf")
    return value


def _text(given: Mapping[str, object], name: str, default: str) -> str:
    value = given.get(name, default)
    if not isinstance(value, str):
        raise UsageError(f"'{name}' is {value!r}: it should be a text", where="ekf")
    return value


def _number(given: Mapping[str, object], name: str, default: float) -> float:
    value: Any = given.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise UsageError(f"'{name}' is {value!r}: it should be a number", where="ekf")
    return float(value)


def _threshold(given: Mapping[str, object], name: str) -> float | None:
    if name not in given:
        return None
    value = _number(given, name, 0.0)
    if value <= 0.0:
        raise UsageError(f"'{name}' is {value:g}: it should be above 0", where="ekf")
    return value


def _numbers(
    given: Mapping[str, object], name: str, sizes: tuple[int, ...], default: se2.Array
) -> se2.Array:
    if name not in given:
        return default
    value: Any = given[name]
    try:
        found = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        found = np.empty(0)
    if found.ndim != 1 or len(found) not in sizes or not np.isfinite(found).all():
        several = " or ".join(str(size) for size in sizes)
        raise UsageError(f"'{name}' is no list of {several} numbers", where="ekf")
    return found


def _planar_matrix(given: Mapping[str, object], name: str, default: se2.Array) -> tuple[float, ...]:
    """The planar part (8 x 8, row-major) of a matrix, or of its diagonal."""
    found = _numbers(given, name, (_SIZE * _SIZE, _SIZE), default.ravel())
    whole = np.diag(found) if len(found) == _SIZE else found.reshape(_SIZE, _SIZE)
    part = whole[np.ix_(PLANAR, PLANAR)]
    part = 0.5 * (part + part.T)
    if np.linalg.eigvalsh(part)[0] < 0.0:
        raise UsageError(f"'{name}' is no covariance: it is not positive", where="ekf")
    return tuple(part.ravel().tolist())
