"""Bundles edited in memory: cut off, moved to another map frame, with poisoned references."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slamreplay.bundle.manifest import MapVersion
from slamreplay.bundle.map_course import map_course
from slamreplay.bundle.schema import JUDGING_KINDS, TABLES
from slamreplay.bundle.sightings import KINDS as SIGHTED_KINDS
from slamreplay.bundle.tables import Ragged, Table
from slamreplay.bundle.view import Bundle, BundleView
from slamreplay.geometry import se2, se3
from slamreplay.maps.grid import OccupancyGrid

_POSED = ("poses", "initial_poses", "references")


def rebuilt(
    bundle: Bundle, tables: Mapping[str, Table], grid: OccupancyGrid | str | None = "same"
) -> Bundle:
    """A bundle in memory with some tables exchanged, and the map too (None takes it away)."""
    whole = {name: tables.get(name, bundle.table(name)) for name in TABLES}
    if isinstance(grid, str):
        return Bundle(bundle.manifest, whole, bundle.grids())
    kept, maps = grid, []
    if kept is not None and bundle.manifest.maps:
        maps = [bundle.manifest.maps[-1].model_copy(update={"version": kept.version})]
    manifest = bundle.manifest.model_copy(update={"maps": maps})
    return Bundle(manifest, whole, {kept.version: kept} if kept is not None else {})


def with_maps(bundle: Bundle, course: Sequence[tuple[int, OccupancyGrid]]) -> Bundle:
    """The bundle with a map of one topic that changes: each grid holds from its time (ns) on."""
    times = np.array([t_ns for t_ns, _ in course], dtype=np.int64)
    columns = {
        "t_ns": times,
        "t_sensor_ns": times,
        "t_log_ns": times,
        "topic": ["/map"] * len(course),
        "map_version": [grid.version for _, grid in course],
        "frame_id": [grid.frame_id for _, grid in course],
    }
    updates = Table(TABLES["map_updates"], columns)
    # The version that holds last is the newest, however often it held before.
    grids = {grid.version: grid for _, grid in sorted(course, key=lambda c: -c[0])}
    span = bundle.manifest.start_ns, bundle.manifest.end_ns
    held = map_course(updates, list(reversed(grids)), *span)
    maps = [
        MapVersion(
            version=version,
            folder=version.removeprefix("sha256:")[:16],
            source="/map",
            width=grid.cells.shape[1],
            height=grid.cells.shape[0],
            resolution_m=grid.resolution_m,
            held_ns=[(h.start_ns, h.end_ns) for h in held if h.version == version],
        )
        for version, grid in reversed(grids.items())
    ]
    manifest = bundle.manifest.model_copy(update={"maps": maps})
    tables = {name: bundle.table(name) for name in TABLES}
    return Bundle(manifest, {**tables, "map_updates": updates}, grids)


def fingerprint(table: Table) -> str:
    """Hash of a table's rows, bit by bit: NaNs with other payloads differ, as do -0 and 0."""
    digest = hashlib.sha256()
    for column in table.schema.columns:
        data = table[column.name]
        if isinstance(data, Ragged):
            digest.update(data.offsets.tobytes() + np.ascontiguousarray(data.values).tobytes())
        elif data.dtype == object:
            digest.update("\0".join(data.tolist()).encode() + b"\1")
        else:
            digest.update(np.ascontiguousarray(data).tobytes())
    return digest.hexdigest()


def fingerprints(evidence: Bundle | BundleView) -> dict[str, str]:
    """Hash of every table by name, and of the map as "map"; a view's references are filtered."""
    found = {name: fingerprint(evidence.table(name)) for name in TABLES}
    grid = evidence.grid if isinstance(evidence, BundleView) else evidence.grid()
    return {**found, "map": "none" if grid is None else grid.version}


def cut(bundle: Bundle, after_ns: int) -> Bundle:
    """The bundle as if recording had stopped at a log time; what is static stays."""
    tables = {}
    for name in TABLES:
        table = bundle.table(name)
        keep = table["t_log_ns"] <= after_ns
        if name == "transforms":
            keep = keep | table["is_static"]
        tables[name] = table.take(keep)
    return rebuilt(bundle, tables)


def without(bundle: Bundle, part: str) -> Bundle:
    """The bundle without its scans, odometry (on tf too), sightings, localizer or map."""
    if part == "map":
        return rebuilt(bundle, {}, None)
    if part == "scans":
        return rebuilt(bundle, {"scans": Table.empty(TABLES["scans"])})
    if part == "sightings":
        references = bundle.table("references")
        sensed = np.isin(references["kind"].astype(str), SIGHTED_KINDS)
        return rebuilt(bundle, {"references": references.take(~sensed)})
    transforms, frames = bundle.table("transforms"), bundle.manifest.frames
    if part == "localizer":
        pairs = zip(transforms["parent_frame"], transforms["child_frame"], strict=True)
        spoken = np.array([{*pair} == {frames.map, frames.odom} for pair in pairs], dtype=bool)
        silent = {"transforms": transforms.take(~spoken), "poses": Table.empty(TABLES["poses"])}
        return rebuilt(bundle, silent)
    keep = transforms["child_frame"] != frames.base
    tables = {"transforms": transforms.take(keep)}
    return rebuilt(bundle, {**tables, "odometry": Table.empty(TABLES["odometry"])})


def with_gap(bundle: Bundle, start_ns: int, end_ns: int) -> Bundle:
    """The bundle without any odometry between two times; scans go on."""
    tables = {}
    for name in ("odometry", "transforms"):
        table = bundle.table(name)
        inside = (table.t_ns > start_ns) & (table.t_ns < end_ns)
        if name == "transforms":
            inside &= ~table["is_static"]
        tables[name] = table.take(~inside)
    return rebuilt(bundle, tables)


def with_repeated_stamps(bundle: Bundle) -> Bundle:
    """Every tenth row of scans, odometry and tf comes twice."""
    tables = {}
    for name in ("scans", "odometry", "transforms"):
        table = bundle.table(name)
        rows = np.arange(len(table))
        tables[name] = table.take(np.sort(np.concatenate([rows, rows[::10]])))
    return rebuilt(bundle, tables)


def moved(bundle: Bundle, T_new_map: ArrayLike) -> Bundle:
    """The same log in a map frame that lies elsewhere.

    Map, initial poses, beliefs, references and the localizer's transforms move by a planar pose
    (3,); what the robot sensed stays.
    """
    T = np.asarray(T_new_map, dtype=np.float64)
    frames = bundle.manifest.frames
    tables = {name: _moved_poses(bundle.table(name), T, frames.map or "map") for name in _POSED}
    transforms = bundle.table("transforms")
    rows = np.flatnonzero(transforms["parent_frame"] == (frames.map or "map"))
    translation = transforms["translation_xyz"].copy()
    rotation = transforms["rotation_xyzw"].copy()
    translation[rows], rotation[rows] = _moved(translation[rows], rotation[rows], T)
    tables["transforms"] = transforms.replace(translation_xyz=translation, rotation_xyzw=rotation)
    grid = bundle.grid()
    if grid is not None:
        origin = se2.compose(T, grid.origin_xyyaw)
        grid = OccupancyGrid(grid.cells, grid.resolution_m, origin, grid.frame_id)
    return rebuilt(bundle, tables, grid)


def poisoned(bundle: Bundle) -> Bundle:
    """The bundle with judging references that lie by a hundred metres."""
    table = bundle.table("references")
    judging = np.isin(table["kind"].astype(str), sorted(JUDGING_KINDS))
    position = table["position_xyz"].copy()
    position[judging] += (100.0, -37.0, 0.0)
    return rebuilt(bundle, {"references": table.replace(position_xyz=position)})


def _moved_poses(table: Table, T: se2.Array, map_frame: str) -> Table:
    rows = np.flatnonzero(table["frame_id"] == map_frame)
    position, orientation = table["position_xyz"].copy(), table["orientation_xyzw"].copy()
    covariance = table["covariance"].copy()
    position[rows], orientation[rows] = _moved(position[rows], orientation[rows], T)
    turn = np.eye(6)
    turn[:2, :2] = turn[3:5, 3:5] = se3.from_planar(T)[:2, :2]
    cov = covariance[rows].reshape(-1, 6, 6)
    covariance[rows] = (turn @ cov @ turn.T).reshape(-1, 36)
    return table.replace(position_xyz=position, orientation_xyzw=orientation, covariance=covariance)


def _moved(
    position: NDArray[np.float64], quaternion: NDArray[np.float64], T: se2.Array
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    yaw = se3.yaw_from_quaternion(quaternion)
    planar = se2.compose(T, np.column_stack([position[:, :2], yaw]))
    xyz = np.column_stack([planar[:, :2], position[:, 2]])
    return xyz, se3.quaternion_from_yaw(planar[:, 2])
