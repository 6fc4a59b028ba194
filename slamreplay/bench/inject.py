"""Faults of the robot put into recorded logs: real scans, and yet the truth is known.

Each function takes a view and gives an `Injection`: the view with one fault in it and what was
done, where and when. Nothing is drawn at random: the caller says where.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slamreplay.bench.injection import Injection
from slamreplay.bundle.belief import arrival_ns
from slamreplay.bundle.manifest import Manifest
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle, BundleView
from slamreplay.errors import UsageError
from slamreplay.geometry import se2, se3
from slamreplay.geometry.times import NO_STAMP, NS_PER_S


def kidnap(view: BundleView, start_ns: int, end_ns: int) -> Injection:
    """The robot is carried: [start, end) is cut out, times close up, odometry is joined.

    The localizer's corrections and poses after the cut are taken away, for the one that ran knew
    the way in between: what is left is a robot that goes on by odometry from where it was taken.

    Raises:
        UsageError: the log has no odometry on both sides of the stretch.
    """
    if odometry_track(view) is None:
        raise UsageError("a log without odometry cannot be joined")
    gap = end_ns - start_ns
    tables = {name: _closed(_whole(view, name), start_ns, end_ns) for name in TABLES}
    joined = _joined(view, tables, start_ns, end_ns)
    tables |= joined
    frames = view.manifest.frames
    transforms = tables["transforms"]
    ends = {frames.map, frames.odom}
    pairs = zip(transforms["parent_frame"], transforms["child_frame"], strict=True)
    correction = np.array([{p, c} == ends for p, c in pairs], dtype=bool)
    manifest = _shortened(view.manifest, start_ns, end_ns)
    knows = manifest.clock.from_log_time(transforms["t_log_ns"]) >= start_ns
    tables["transforms"] = transforms.take(~(correction & knows))
    for name in ("poses", "initial_poses", "particles"):
        knows = manifest.clock.from_log_time(tables[name]["t_log_ns"]) >= start_ns
        tables[name] = tables[name].take(~knows)
    injected = _view_of(view, tables, manifest)
    return Injection("kidnap", injected, start_ns, cut_ns=(start_ns, start_ns + gap))


def wrong_start(view: BundleView, from_ns: int, offset_xyyaw: ArrayLike) -> Injection:
    """The belief is moved from a time on, as a wrong initial pose would: it goes on from there.

    Args:
        view: the evidence; it must hold a belief.
        from_ns: corrections and poses that arrive later are moved.
        offset_xyyaw: (3,) the believed pose seen from the right one at that moment: m, m, rad.

    Raises:
        UsageError: the log holds no belief at that time.
    """
    believed = _believed(view, from_ns)
    T_moved = se2.compose(
        se2.compose(believed, np.asarray(offset_xyyaw, dtype=np.float64)), se2.inverse(believed)
    )
    frames = view.manifest.frames
    transforms = view.table("transforms")
    parents, children = transforms["parent_frame"], transforms["child_frame"]
    late = arrival_ns(view, transforms["t_log_ns"]) >= from_ns
    down = late & (parents == frames.map) & (children == frames.odom)
    up = late & (parents == frames.odom) & (children == frames.map)
    T = se3.planar(se3.matrix(transforms["translation_xyz"], transforms["rotation_xyzw"]))
    T[down] = se2.compose(T_moved, T[down])
    T[up] = se2.compose(T[up], se2.inverse(T_moved))
    transforms = _with_planar(transforms, T, down | up, "translation_xyz", "rotation_xyzw")
    poses = view.table("poses")
    late = arrival_ns(view, poses["t_log_ns"]) >= from_ns
    T = se3.planar(se3.matrix(poses["position_xyz"], poses["orientation_xyzw"]))
    T[late] = se2.compose(T_moved, T[late])
    poses = _with_planar(poses, T, late, "position_xyz", "orientation_xyzw")
    return Injection("wrong_start", view.with_table(transforms).with_table(poses), from_ns)


def with_localizer(view: BundleView, track: PoseTrack, every_s: float = 0.5) -> BundleView:
    """A view whose belief is a given track: for logs that hold no localizer, or one that erred.

    The track's poses of the base in the map become map -> odom on tf, as AMCL would publish them;
    every other word of a localizer is taken away.

    Raises:
        UsageError: the log has no odometry, or no odom frame, to hang it on.
    """
    odometry, frames = odometry_track(view), view.manifest.frames
    if odometry is None or frames.odom is None:
        raise UsageError("a localizer needs odometry to correct")
    known = track.take(track.has_pose)
    step = np.concatenate([[0], np.cumsum(np.diff(known.t_ns)) // int(every_s * NS_PER_S)])
    known = known.take(np.flatnonzero(np.append(True, step[1:] != step[:-1])))
    T = se2.compose(known.xyyaw, se2.inverse(odometry.at(known.t_ns).xyyaw))
    finite = np.isfinite(T).all(axis=1)
    T, t_ns = T[finite], known.t_ns[finite]
    transforms = view.table("transforms")
    ends = {frames.map or track.frame_id, frames.odom}
    pairs = zip(transforms["parent_frame"], transforms["child_frame"], strict=True)
    others = transforms.take(np.array([{p, c} != ends for p, c in pairs], dtype=bool))
    n = len(t_ns)
    rows: dict[str, Any] = {
        "t_ns": t_ns,
        "t_sensor_ns": t_ns,
        "t_log_ns": _log_times(view, t_ns),
        "topic": np.full(n, "/tf", dtype=object),
        "parent_frame": np.full(n, frames.map or track.frame_id, dtype=object),
        "child_frame": np.full(n, frames.odom, dtype=object),
        "is_static": np.zeros(n, dtype=bool),
        "translation_xyz": np.column_stack([T[:, :2], np.zeros(n)]),
        "rotation_xyzw": se3.quaternion_from_yaw(T[:, 2]),
    }
    schema = TABLES["transforms"]
    added = Table.concat(schema, [others, Table(schema, rows)]).sorted_by_time()
    tables = {name: _whole(view, name) for name in TABLES}
    empty = {name: Table.empty(TABLES[name]) for name in ("poses", "particles")}
    named = frames.model_copy(update={"map": frames.map or track.frame_id})
    told = [r for r in view.manifest.roles if r.role not in ("pose", "covariance", "particles")]
    manifest = view.manifest.model_copy(update={"frames": named, "roles": told})
    return _view_of(view, {**tables, **empty, "transforms": added}, manifest)


def _whole(view: BundleView, name: str) -> Table:
    """A table of the view, with the references that only judge: they go through the same cut."""
    return view.bundle.table(name) if name == "references" else view.table(name)


def _view_of(view: BundleView, tables: Mapping[str, Table], manifest: Manifest) -> BundleView:
    bundle = Bundle(manifest, tables, view.bundle.grids())
    return BundleView(
        bundle, replaced_grid=view.replaced_grid, redrawn=view.redrawn, settings=view.settings
    )


def _closed(table: Table, start_ns: int, end_ns: int) -> Table:
    """Rows without those of [start, end), later ones moved up; what is latched stays."""
    latched = np.zeros(len(table), dtype=bool)
    if table.schema.name == "transforms":
        latched = table["is_static"]
    elif table.schema.name in ("map_updates", "initial_poses"):
        latched = np.ones(len(table), dtype=bool)
    late = (table.t_ns >= end_ns) & ~latched
    keep = latched | (table.t_ns < start_ns) | late
    back = np.where(late, end_ns - start_ns, 0)
    stamps = table["t_sensor_ns"]
    columns = {
        "t_ns": table.t_ns - back,
        "t_sensor_ns": np.where(stamps == NO_STAMP, stamps, stamps - back),
        "t_log_ns": table["t_log_ns"] - back,
    }
    return table.replace(**columns).take(keep)


def _shortened(manifest: Manifest, start_ns: int, end_ns: int) -> Manifest:
    gap = end_ns - start_ns
    knots = [k for k in manifest.clock.knots if k[1] < start_ns]
    knots += [(k[0] - gap, k[1] - gap) for k in manifest.clock.knots if k[1] >= end_ns]
    clock = manifest.clock.model_copy(update={"knots": knots or manifest.clock.knots[:1]})
    return manifest.model_copy(update={"clock": clock, "end_ns": manifest.end_ns - gap})


def _joined(
    view: BundleView, tables: Mapping[str, Table], start_ns: int, end_ns: int
) -> dict[str, Table]:
    """Odometry and tf whose poses after the cut go on from where they were before it."""
    frames = view.manifest.frames
    transforms, odometry = tables["transforms"], tables["odometry"]
    carried = (transforms["parent_frame"] == frames.odom) & ~transforms["is_static"]
    carried &= transforms["child_frame"] != frames.map
    for child in sorted(set(transforms["child_frame"][carried])):
        rows = carried & (transforms["child_frame"] == child)
        T = _rejoined(transforms, rows, view.table("transforms"), start_ns, end_ns, "child_frame")
        transforms = _with_planar(transforms, T, rows, "translation_xyz", "rotation_xyzw")
    for topic in sorted(set(odometry["topic"])):
        rows = odometry["topic"] == topic
        T = _rejoined(odometry, rows, view.table("odometry"), start_ns, end_ns, "topic")
        odometry = _with_planar(odometry, T, rows, "position_xyz", "orientation_xyzw")
    return {"transforms": transforms, "odometry": odometry}


def _rejoined(
    table: Table, rows: NDArray[np.bool_], source: Table, start_ns: int, end_ns: int, key: str
) -> se2.Array:
    """(N, 3) planar poses of all rows; of `rows` after the cut, moved so that nothing jumps."""
    names = {"transforms": ("translation_xyz", "rotation_xyzw")}
    xyz, quaternion = names.get(table.schema.name, ("position_xyz", "orientation_xyzw"))
    out = se3.planar(se3.matrix(table[xyz], table[quaternion]))
    own = source.take(source[key] == table[key][np.flatnonzero(rows)[0]]).sorted_by_time()
    poses = se3.planar(se3.matrix(own[xyz], own[quaternion]))
    t_ns = own.t_ns
    if not (t_ns[0] <= start_ns and end_ns <= t_ns[-1]):
        raise UsageError(f"{own[key][0]} has no odometry on both sides of the cut")
    at = se2.interpolate(t_ns, poses, np.array([start_ns, end_ns]))
    T_join = se2.compose(at[0], se2.inverse(at[1]))
    late = rows & (table.t_ns >= start_ns)
    out[late] = se2.compose(T_join, out[late])
    return out


def _with_planar(
    table: Table, T: se2.Array, rows: NDArray[np.bool_], xyz: str, quaternion: str
) -> Table:
    """The table with the planar part of the poses under a mask exchanged; heights stay."""
    position, rotation = table[xyz].copy(), table[quaternion].copy()
    position[rows, :2] = T[rows, :2]
    rotation[rows] = se3.quaternion_from_yaw(T[rows, 2])
    return table.replace(**{xyz: position, quaternion: rotation})


def _believed(view: BundleView, at_ns: int) -> se2.Array:
    from slamreplay.bundle.belief import recorded_belief

    belief = recorded_belief(view, np.array([at_ns], dtype=np.int64))
    if belief is None or not belief.has_pose[0]:
        raise UsageError("there is no belief to move at that time")
    return np.asarray(belief.xyyaw[0])


def _log_times(view: BundleView, t_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Log times (N,) that the clock carries over to these times."""
    knots = view.manifest.clock.knots
    if not knots:
        return t_ns
    log, own = (np.array(v, dtype=np.int64) for v in zip(*knots, strict=True))
    late = np.interp((t_ns - own[0]).astype(np.float64), (own - own[0]).astype(np.float64),
                     (log - own - (log[0] - own[0])).astype(np.float64))  # fmt: skip
    return t_ns + (log[0] - own[0]) + np.rint(late).astype(np.int64)
