"""Recoveries that nobody recorded, inferred from what the robot and its costmaps did.

They are the lesser evidence: a person with a joystick turns on the spot too. So nothing is inferred
of a kind that the log itself tells of, and a part of the bundle that is missing stays missing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from slamreplay.bundle.manifest import Manifest
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.recoveries import INFERRED, kind_of_recovery, tells_of_every_recovery
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.store import Rows
from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import Bundle, BundleView
from slamreplay.geometry import se3
from slamreplay.geometry.times import NO_STAMP
from slamreplay.geometry.transforms import clean_frame
from slamreplay.ingest.assembly import Assembly
from slamreplay.ingest.inferred_clearing import clearings
from slamreplay.ingest.inferred_motion import Manoeuvre, manoeuvres

#: A robot this near to the end of its plan has come there.
ARRIVED_M = 0.5
_READ = ("odometry", "transforms", "commands", "plans")
_NAMES = {"clear": "clear costmap", "spin": "spin", "backup": "backup"}


def with_inferred(manifest: Manifest, tables: Mapping[str, Assembly]) -> dict[str, Rows]:
    """The tables, `recoveries` with a row for each recovery inferred.

    Args:
        manifest: of the bundle that the tables will be.
        tables: on the bundle's clock.
    """
    told = _kinds_told(manifest, tables.get("recoveries"))
    rows: list[tuple[str, int, str, int]] = []
    if "clear" not in told and "costmaps" in tables:
        rows += [("clear", *row) for row in clearings(tables["costmaps"].groups())]
    if {"spin", "backup"} - told:
        view = Bundle(manifest, {n: _whole(tables[n]) for n in _READ if n in tables}, {}).view()
        moves = [move for move in _moves(view) if move.kind not in told]
        rows += [(move.kind, move.start_ns, *_source(view, move)) for move in moves]
    if not rows:
        return dict(tables)
    kinds, t_ns, topics, t_log_ns = zip(
        *sorted(rows, key=lambda row: (row[1], row[0])), strict=True
    )
    columns = {
        "t_ns": np.array(t_ns, dtype=np.int64),
        "t_sensor_ns": np.full(len(rows), NO_STAMP),
        "t_log_ns": np.array(t_log_ns, dtype=np.int64),
        "topic": _texts(topics),
        "name": _texts([_NAMES[kind] for kind in kinds]),
        "status": _texts(["running"] * len(rows)),
        "goal": _texts([""] * len(rows)),
        "source": _texts([INFERRED] * len(rows)),
    }
    schema = TABLES["recoveries"]
    recorded = [_whole(tables["recoveries"])] if "recoveries" in tables else []
    whole = Table.concat(schema, [*recorded, Table(schema, columns)])
    return {**tables, "recoveries": whole.sorted_by_time()}


def _whole(rows: Assembly) -> Table:
    """The table in memory, without the covariances: a third of it is nothing else."""
    nothing = np.full(1, np.nan)
    return Table(
        rows.schema,
        {
            c.name: np.broadcast_to(nothing, (len(rows), c.size)) if "covariance" in c.name
            else rows[c.name]
            for c in rows.schema.columns
        },
    )  # fmt: skip


def _kinds_told(manifest: Manifest, recoveries: Assembly | None) -> set[str]:
    """Kinds of recoveries that the log tells of, or would have if there had been any."""
    role = next((r for r in manifest.roles if r.role == "recovery"), None)
    if role is not None and tells_of_every_recovery(role.type):
        return set(_NAMES)
    names = set() if recoveries is None else set(recoveries["name"].tolist())
    return {kind_of_recovery(str(name)) for name in (*names, role.topic if role else "")}


def _moves(view: BundleView) -> Sequence[Manoeuvre]:
    track = odometry_track(view)
    if track is None:
        return ()
    return manoeuvres(track, view.role("command"), lambda t_ns: _at_goal(view, t_ns))


def _at_goal(view: BundleView, t_ns: int) -> bool | None:
    """Whether the robot was at the end of its latest plan, None where that is not known."""
    plans, base = view.role("plan"), view.manifest.frames.base
    rows = np.zeros(0, dtype=np.int64) if plans is None else np.flatnonzero(plans.t_ns <= t_ns)
    if plans is None or base is None or not len(rows):
        return None
    row = int(rows[np.argmax(plans.t_ns[rows])])
    frame, goal = clean_frame(str(plans["frame_id"][row])), plans["xyyaw"][row].reshape(-1, 3)[-1:]
    if not len(goal) or not view.transforms.has_path(frame, base):
        return None
    T, known = view.transforms.lookup(frame, base, np.array([t_ns]))
    away = float(np.hypot(*(goal - se3.planar(T))[0, :2]))
    return away <= ARRIVED_M if known[0] else None


def _source(view: BundleView, move: Manoeuvre) -> tuple[str, int]:
    """Topic and log time of the odometry a manoeuvre begins with."""
    table = view.role("odometry")
    if table is None or not len(table):
        table = view.table("transforms")
        table = table.take(table["child_frame"] == view.manifest.frames.base)
    row = int(np.argmin(np.abs(table.t_ns - move.start_ns)))
    return str(table["topic"][row]), int(table["t_log_ns"][row])


def _texts(values: Sequence[str]) -> np.ndarray:
    out = np.empty(len(values), dtype=object)
    out[:] = values
    return out
