"""A laser of a CARMEN log: its scans, and where it sits on the robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.manifest import Loss
from slamreplay.bundle.tables import Ragged
from slamreplay.geometry import se2
from slamreplay.geometry.times import Times
from slamreplay.ingest.text_logs.carmen_lines import Group
from slamreplay.ingest.text_logs.no_return_code import MAX_M, no_return_code

#: Degrees between beams by the number of readings, as CARMEN guesses it
#: (carmen_laser_guess_angle_increment in global/readlog.c): of 180, 360 and 400 the last beam of
#: the half circle is left out. Those of 270 degrees came later; they are what the LMS 100 sends.
_STEP_DEG = {180: 1.0, 181: 1.0, 360: 0.5, 361: 0.5, 400: 0.25, 401: 0.25,
             540: 0.5, 541: 0.5, 1080: 0.25, 1081: 0.25}  # fmt: skip
#: A laser that most lines have within this of one place is fixed to the robot: m, rad, share.
_FIXED_M, _FIXED_RAD, _MOST = 0.02, 0.02, 0.95


@dataclass(frozen=True, eq=False)
class Laser:
    """The lines of one laser.

    Attributes:
        name: keyword of the lines.
        frame: of the laser.
        scans: columns of table scans.
        robot_xyyaw: (N, 3) odometry on the lines, NaN where they have none.
        velocity: (N, 2) forward m/s and turn rate rad/s on the lines, NaN where they have none.
        mount_xyyaw: (3,) the laser on the robot; None where neither lines nor PARAM tell.
        t_sensor_ns: (N,) ipc times.
        t_log_ns: (N,) logger's times.
        losses: what of the lines was not used.
    """

    name: str
    frame: str
    scans: Mapping[str, Any]
    robot_xyyaw: se2.Array
    velocity: se2.Array
    mount_xyyaw: se2.Array | None
    t_sensor_ns: Times
    t_log_ns: Times
    losses: list[Loss]


def laser_of(groups: Sequence[Group], params: Mapping[str, str], file: str) -> Laser:
    """The laser behind the lines of one keyword.

    Args:
        groups: of that keyword.
        params: PARAM lines of the log.
        file: name of the file, for the losses.
    """
    name = groups[0].keyword
    number = {"FLASER": 1, "RLASER": 2}.get(name) or int(name[-1])
    frame = {1: "laser", 2: "rear_laser"}.get(number, f"laser_{number}")
    order = np.argsort(np.concatenate([g.line for g in groups]))
    parts = [_columns(g, params, number) for g in groups]
    columns = {k: np.concatenate([p[k] for p in parts])[order] for k in parts[0]}
    ranges = _stacked([g.fields[:, g.layout.configuration + 1 :][:, : g.layout.readings]
                       for g in groups]).take(order)  # fmt: skip
    sound = np.isfinite(columns["start"]) & (np.abs(columns["step"]) > 0.0) & (ranges.lengths > 0)
    sound &= np.isfinite(columns["step"])
    keep = np.flatnonzero(sound)
    columns, ranges = {k: v[keep] for k, v in columns.items()}, ranges.take(keep)
    losses = _counted("lost", f"{file}: {name}", int((~sound).sum()), "no beams, or no angles")
    stated = columns["limit"]
    code = no_return_code(ranges, float(np.median(stated)) if len(stated) else MAX_M)
    none = int(np.isnan(ranges.values).sum())
    losses += _counted("lost", f"{file}: ranges of {name}", none, "they are no number")
    zero = np.zeros(len(keep))
    scans = {
        "frame_id": np.full(len(keep), frame, dtype=object),
        "angle_min_rad": columns["start"],
        "angle_increment_rad": columns["step"],
        "time_increment_s": zero,
        "scan_time_s": zero,
        "range_min_m": zero,
        "range_max_m": stated if code is None else np.full(len(keep), code),
        "ranges_m": Ragged(ranges.values.astype(np.float32), ranges.offsets),
    }
    robot = np.column_stack([columns[k] for k in ("x", "y", "yaw")])
    seat = np.column_stack([columns[k] for k in ("laser_x", "laser_y", "laser_yaw")])
    mount, remarks = _mount(robot, seat, _mount_of_params(params, number), f"{file}: {name}")
    return Laser(
        name,
        frame,
        scans,
        robot,
        np.column_stack([columns["tv"], columns["rv"]]),
        mount,
        np.concatenate([g.t_sensor_ns for g in groups])[order][keep],
        np.concatenate([g.t_log_ns for g in groups])[order][keep],
        losses + remarks,
    )


def _columns(group: Group, params: Mapping[str, str], number: int) -> dict[str, se2.Array]:
    """Single numbers of each line: angles, limit, poses, velocities."""
    fields, layout, n = group.fields, group.layout, len(group.line)
    if layout.configuration:
        start, fov, step, limit = fields[:, 1], fields[:, 2], fields[:, 3], fields[:, 4]
        step = np.where(step == 0.0, fov / max(layout.readings - 1, 1), step)
        limit = np.where(limit > 0.0, limit, MAX_M)
    else:
        first, between = _angles(layout.readings, _param(params, _RESOLUTION.get(number, ())))
        start, step = np.full(n, first), np.full(n, between)
        stated = _param(params, _LIMIT.get(number, ()))
        limit = np.full(n, stated if stated is not None and stated > 0.0 else MAX_M)
    tail = fields[:, layout.tail :]
    tail = np.hstack([tail, np.full((n, 8 - min(tail.shape[1], 8)), np.nan)])
    names = ("laser_x", "laser_y", "laser_yaw", "x", "y", "yaw", "tv", "rv")
    named = {k: tail[:, i] for i, k in enumerate(names)}
    return {"start": start, "step": step, "limit": limit, **named}


def _angles(readings: int, resolution_deg: float | None) -> tuple[float, float]:
    """Bearing of the first beam and the step between beams, rad.

    Half a circle begins at -90 degrees, whether its last beam was kept or not; another field of
    view looks straight ahead.
    """
    step = resolution_deg or _STEP_DEG.get(readings) or 180.0 / max(readings - 1, 1)
    half = any(abs(n * step - 180.0) < 1e-6 for n in (readings, readings - 1))
    start = -90.0 if half else -0.5 * step * (readings - 1)
    return float(np.radians(start)), float(np.radians(step))


#: Names of PARAM by laser.
_RESOLUTION = {1: ("laser_front_laser_resolution",), 2: ("laser_rear_laser_resolution",)}
_LIMIT = {1: ("robot_front_laser_max", "simulator_frontlaser_maxrange"),
          2: ("robot_rear_laser_max", "simulator_rearlaser_maxrange")}  # fmt: skip
_SIDES = {1: "robot_frontlaser", 2: "robot_rearlaser"}


def _param(params: Mapping[str, str], names: Sequence[str]) -> float | None:
    """The first of these parameters that is a number."""
    for name in names:
        try:
            value = float(params.get(name, ""))
        except ValueError:
            continue
        if np.isfinite(value):
            return value
    return None


def _mount_of_params(params: Mapping[str, str], number: int) -> se2.Array | None:
    """Where PARAM puts a laser on the robot.

    A rear laser is placed only where its angle is told: without one, versions of CARMEN differ in
    which way they count the offset of a laser that looks back.
    """
    side = _SIDES.get(number, "")
    names = (f"{side}_offset", f"{side}_side_offset", f"{side}_angular_offset")
    x, y, yaw = (_param(params, (name,)) for name in names)
    if x is None or (number != 1 and yaw is None):
        return None
    return np.array([x, y or 0.0, yaw or 0.0])


def _mount(
    robot: se2.Array, seat: se2.Array, said: se2.Array | None, what: str
) -> tuple[se2.Array | None, list[Loss]]:
    """Where the laser sits on the robot: by the lines, else by PARAM.

    Logs that went through a scan matcher hold the corrected pose of the laser beside the odometry
    of the robot: these do not keep one distance.
    """
    rows = np.isfinite(robot).all(axis=1) & np.isfinite(seat).all(axis=1)
    if not rows.any():
        return said, []
    apart = se2.between(robot[rows], seat[rows])
    middle = np.median(apart[:, :2], axis=0)
    yaw = np.arctan2(np.median(np.sin(apart[:, 2])), np.median(np.cos(apart[:, 2])))
    near = np.hypot(*(apart[:, :2] - middle).T) <= _FIXED_M
    near &= np.abs(se2.wrap_angle(apart[:, 2] - yaw)) <= _FIXED_RAD
    if near.mean() < _MOST:
        reason = "laser poses that keep no one place on the robot: corrected ones"
        return said, _counted("skipped", what, int(rows.sum()), reason)
    mount = np.round(np.append(middle, yaw), 6) + 0.0  # the lines have six digits; no -0
    if said is not None and not np.allclose(said, mount, atol=_FIXED_M):
        reason = f"PARAM puts the laser at {_place(said)} on the robot, the lines at "
        reason += f"{_place(mount)}: the lines hold"
        return mount, _counted("skipped", what, 1, reason)
    return mount, []


def _place(xyyaw: se2.Array) -> str:
    return " ".join(f"{value:g}" for value in xyyaw.tolist())


def _stacked(parts: Sequence[NDArray[np.float64]]) -> Ragged:
    lengths = np.concatenate([np.full(len(p), p.shape[1], dtype=np.int64) for p in parts])
    offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    return Ragged(np.concatenate([p.ravel() for p in parts]), offsets)


def _counted(kind: str, what: str, count: int, reason: str) -> list[Loss]:
    return [Loss(kind=kind, what=what, count=count, reason=reason)] if count else []  # type: ignore[arg-type]
