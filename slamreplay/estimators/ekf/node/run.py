"""The node over a whole log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.run import Estimate, Innovations
from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.estimators.ekf.kernels import ACCEPTED
from slamreplay.estimators.ekf.node import kernels
from slamreplay.estimators.ekf.node.measurements import Part, parts_of
from slamreplay.estimators.ekf.node.parameters import NodeParameters
from slamreplay.estimators.start import GLOBAL, MOVED, Start, starts
from slamreplay.geometry.times import Times

AXES = ("x m", "y m", "yaw rad", "vx m/s", "vy m/s", "vyaw rad/s", "ax m/s^2", "ay m/s^2")
_SIZE = kernels.STATES


def run_node(
    view: BundleView,
    parameters: NodeParameters,
    name: str,
    process_scale: float,
    measurement_scale: float,
) -> Estimate:
    """One row per scan (per odometry sample without scans, per message of the first input else).

    In the world frame of the parameters. Where that is the map frame, the first pose that somebody
    gave starts the filter, as the node's `set_pose` does; else the first measurement does.

    Raises:
        NotApplicableError: the log has none of the inputs, or a start is to be moved or forgotten
            that the node does not have.
    """
    parts, messages = parts_of(view, parameters)
    if not parts:
        inputs = ", ".join(f"{one.name} {one.topic}" for one in parameters.inputs)
        hint = f"the log has {', '.join(_topics(view)) or 'none that could be one'}"
        if any(messages.values()):
            base = parameters.base_frame or view.manifest.frames.base or "base_link"
            hint = f"nothing is chosen by its _config, or tf leads to neither {base} nor the world"
        raise NotApplicableError(
            f"none of its inputs measures anything in this log: {inputs}", where=name, hint=hint
        )
    row_ns = _rows(view, parts)
    start = _start(view, parameters, row_ns, name)
    K = sum(len(part) for part in parts)
    t_ns = np.concatenate([*(part.t_ns for part in parts), row_ns])
    order = np.argsort(t_ns, kind="stable")  # at equal times measurements come before rows
    n = len(row_ns)
    xyyaw, cov, updated = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan), np.full(n, np.nan)
    residual, S = np.full((K, _SIZE), np.nan), np.full((K, _SIZE, _SIZE), np.nan)
    status, moved = np.zeros(K, dtype=np.int64), np.full((K, 3), np.nan)
    used = np.concatenate([part.used for part in parts])
    x = np.array(parameters.initial_state)
    P = np.array(parameters.initial_covariance).reshape(_SIZE, _SIZE)
    start_ns = np.int64(-1)
    if start is not None and start.xyyaw is not None:
        x[:3], P[:3, :3], start_ns = start.xyyaw, start.cov, row_ns[start.row]
    kernels.run(
        t_ns[order], np.where(order < K, order, -1), np.where(order >= K, order - K, -1),
        np.concatenate([part.z for part in parts]),
        measurement_scale * np.concatenate([part.R for part in parts]), used,
        np.concatenate([part.lever for part in parts]),
        np.concatenate([np.full(len(part), part.threshold) for part in parts]),
        process_scale * np.array(parameters.process_noise).reshape(_SIZE, _SIZE),
        parameters.scales_with_speed, x, P, start_ns, xyyaw, cov, updated, residual, S, status,
        moved,
    )  # fmt: skip
    base = parameters.base_frame or view.manifest.frames.base or "base_link"
    track = PoseTrack(parameters.world_frame, base, row_ns, xyyaw, cov)
    scalars = {f"{one}.messages": float(count) for one, count in messages.items()}
    innovations, first = [], 0
    for part in parts:
        rows = np.arange(first, first + len(part))
        first += len(part)
        frame = parameters.world_frame if part.is_pose else base
        held = rows[np.isfinite(moved[rows, 0])]
        accepted = status[held] == ACCEPTED
        scalars[f"{part.source}.accepted"] = float(accepted.sum())
        scalars[f"{part.source}.rejected"] = float((~accepted).sum())
        for axes, rows_of in _by_axes(used, held):
            index = np.arange(len(axes))
            innovations.append(
                Innovations(
                    part.source,
                    t_ns[rows_of],
                    residual[rows_of][:, index],
                    S[rows_of][:, index[:, None], index],
                    status[rows_of] == ACCEPTED,
                    axes,
                    frame,
                    moved[rows_of],
                    np.full(len(rows_of), part.topic),
                )
            )
    return Estimate(track, tuple(innovations), {"updated": updated}, scalars)


def _by_axes(
    used: NDArray[np.bool_], rows: NDArray[np.int64]
) -> Iterator[tuple[tuple[str, ...], NDArray[np.int64]]]:
    """Rows of measurements that measured the same, and the names of what that is."""
    if not len(rows):
        return
    kinds, which = np.unique(used[rows], axis=0, return_inverse=True)
    for k, kind in enumerate(kinds):
        yield tuple(np.array(AXES)[kind].tolist()), rows[which.ravel() == k]


def _rows(view: BundleView, parts: Sequence[Part]) -> Times:
    scans = scan_set(view)
    if scans is not None:
        return scans.t_ns
    odometry = odometry_track(view)
    return parts[0].t_ns if odometry is None or not len(odometry) else odometry.t_ns


def _start(view: BundleView, parameters: NodeParameters, row_ns: Times, name: str) -> Start | None:
    """The pose that was given to it, where it estimates in the map."""
    is_map = parameters.world_frame == parameters.map_frame
    if view.settings.get(GLOBAL) or (not is_map and not MOVED.isdisjoint(view.settings)):
        what = "cannot find itself" if is_map else "estimates in no map: it has no start to move"
        raise NotApplicableError(what, where=name)
    if not is_map:
        return None
    T_odom_base = np.zeros((len(row_ns), 3))  # a start holds at its own row, nothing carries it
    odometry = odometry_track(view)
    if odometry is not None and len(odometry):
        T_odom_base = odometry.at(row_ns).xyyaw
    given = starts(view, row_ns, T_odom_base)
    return given[0] if given else None


def _topics(view: BundleView) -> list[str]:
    found: set[str] = set()
    for table in ("odometry", "imu", "velocities", "poses"):
        found |= {str(topic) for topic in set(view.recorded(table)["topic"])}
    return sorted(found)[:8]
