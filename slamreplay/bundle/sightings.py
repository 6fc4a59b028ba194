"""Tags and docks as the robot sensed them, in the plane of its base."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.mounting import planar_mount
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2, se3
from slamreplay.geometry.covariance import ANY_ANGLE
from slamreplay.geometry.transforms import TransformBuffer

#: Kinds of references that are things which stand still and that the robot senses.
KINDS = ("fiducial", "dock")
#: What a detector that says nothing of its noise is taken to have: metres, metres per metre of
#: distance, radians. Single-camera tag detectors lie within that (Olson 2011, figure 9).
_NEAR_M, _PER_M, _YAW = 0.03, 0.04, 0.1
#: An axis of a tag that is this much less level than its most level one is no heading.
_LEVEL = 0.9


@dataclass(frozen=True, eq=False)
class Sightings:
    """N sightings of things that stand still.

    Attributes:
        t_ns: (N,) when.
        kind: (N,) fiducial or dock.
        name: (N,) which one, its kind included: "fiducial tag_3".
        xyyaw: (N, 3) the thing in the robot's base, m, m, rad; the heading is that of its most
            level axis, NaN where the sensor does not tell it.
        cov: (N, 3, 3) in the base's axes, m^2 and rad^2.
        stated: (N, 3, 3) what the log itself states of it, NaN where it does not; the heading
            stands apart from the place.
        surveyed: poses (3,) in the map of the things whose place the log itself states; a heading
            that is never sensed is NaN here too.
    """

    t_ns: NDArray[np.int64]
    kind: NDArray[np.object_]
    name: NDArray[np.object_]
    xyyaw: se2.Array
    cov: se2.Array
    stated: se2.Array
    surveyed: Mapping[str, se2.Array]

    def __len__(self) -> int:
        return len(self.t_ns)


def sightings_of(view: BundleView, motion: PoseTrack) -> Sightings | None:
    """What the view holds of them, or None.

    A camera whose place on the robot is not on tf is placed by what it saw while the robot moved;
    where that does not tell either, its sightings are left out.

    Args:
        view: the evidence.
        motion: the base in a frame that drifts by little within some seconds.
    """
    table = view.table("references")
    table = table.take(np.isin(table["kind"].astype(str), KINDS))
    if not len(table):
        return None
    table = table.sorted_by_time()
    base, map_frame = view.manifest.frames.base or "base_link", view.manifest.frames.map
    names = np.array([f"{k} {c}" for k, c in zip(table["kind"], table["child_frame_id"],
                                                 strict=True)], dtype=object)  # fmt: skip
    T_frame_thing = se3.matrix(table["position_xyz"], table["orientation_xyzw"])
    T_base_frame = np.full((len(table), 4, 4), np.nan)
    for frame in sorted(set(table["frame_id"])):
        rows = np.flatnonzero(table["frame_id"] == frame)
        T_base_frame[rows] = _mount(
            view.transforms, base, frame, map_frame, table.t_ns[rows], names[rows],
            T_frame_thing[rows, :3, 3], motion,
        )  # fmt: skip
    known = np.flatnonzero(np.isfinite(T_base_frame).all(axis=(1, 2)))
    if not len(known):
        return None
    T = T_base_frame[known] @ T_frame_thing[known]
    surveys = _surveys(view.transforms, map_frame, table.take(known), names[known])
    yaw, surveyed = _headings(T, names[known], surveys)
    stated = _stated(table["covariance"][known], T_base_frame[known, :3, :3])
    cov = _with_usual(stated, T[:, :2, 3])
    cov[np.isnan(yaw), 2, 2] = ANY_ANGLE
    return Sightings(
        table.t_ns[known],
        table["kind"][known],
        names[known],
        np.column_stack([T[:, :2, 3], yaw]),
        cov,
        stated,
        surveyed,
    )


def _mount(
    buffer: TransformBuffer,
    base: str,
    frame: str,
    map_frame: str | None,
    t_ns: NDArray[np.int64],
    names: NDArray[np.object_],
    position: se2.Array,
    motion: PoseTrack,
) -> se2.Array:
    """(M, 4, 4) the sensing frame in the base at each time; NaN where it is not known."""
    if frame == base or not frame:
        return np.broadcast_to(np.eye(4), (len(t_ns), 4, 4))
    if buffer.has_path(base, frame):
        ends = {f for edge in buffer.path(base, frame) for f in (edge.parent, edge.child)}
        if map_frame in ends:  # by way of the localizer's own correction: a belief, no sighting
            return np.full((len(t_ns), 4, 4), np.nan)
        T, valid = buffer.lookup(base, frame, t_ns)
        return np.where(valid[:, None, None], T, np.nan)
    mount = planar_mount(t_ns, names, position, motion)
    return np.broadcast_to(np.full((4, 4), np.nan) if mount is None else mount, (len(t_ns), 4, 4))


def _surveys(
    buffer: TransformBuffer, map_frame: str | None, table: Table, names: NDArray[np.object_]
) -> dict[str, se2.Array]:
    """T_map_thing (4, 4) of things that static transforms tie to the map."""
    found = {}
    for name, frame in sorted(set(zip(names, table["child_frame_id"], strict=True))):
        T = buffer.fixed(map_frame, frame) if map_frame and frame in buffer.edges else None
        if T is not None:
            found[name] = T
    return found


def _headings(
    T: se2.Array, names: NDArray[np.object_], surveys: Mapping[str, se2.Array]
) -> tuple[se2.Array, dict[str, se2.Array]]:
    """Headings (N,) of each thing's most level axis, and the surveyed planar poses.

    A tag on the ceiling has its x axis level, one on a wall may have it upright. What is sensed as
    a point, even once, has no heading, and whatever its survey says of one has no counterpart.
    """
    yaw, planar = np.zeros(len(T)), {}
    level = np.hypot(T[:, 0, :3], T[:, 1, :3])
    for name in sorted(set(names)):
        rows = names == name
        if not np.isfinite(level[rows]).all():
            yaw[rows] = np.nan
            if name in surveys:
                planar[name] = np.array([*surveys[name][:2, 3], np.nan])
            continue
        mean = level[rows].mean(axis=0)
        axis = int(np.flatnonzero(mean >= _LEVEL * mean.max())[0])
        yaw[rows] = np.arctan2(T[rows, 1, axis], T[rows, 0, axis])
        if name in surveys:
            S = surveys[name]
            planar[name] = np.array([S[0, 3], S[1, 3], np.arctan2(S[1, axis], S[0, axis])])
    return yaw, planar


def _with_usual(stated: se2.Array, xy: se2.Array) -> se2.Array:
    """(N, 3, 3) what is stated beside what detectors usually have, which no message makes less."""
    out = np.where(np.isfinite(stated), stated, 0.0)
    usual = (_NEAR_M + _PER_M * np.hypot(xy[:, 0], xy[:, 1])) ** 2
    out[:, 0, 0] += usual
    out[:, 1, 1] += usual
    out[:, 2, 2] += _YAW**2
    return out


def _stated(covariance: se2.Array, R: se2.Array) -> se2.Array:
    """(N, 3, 3) the messages' covariances in axes of the base, NaN where they are none."""
    out = np.full((len(R), 3, 3), np.nan)
    # An infinite variance says no more than none at all, and products of it would warn.
    full = np.where(np.isfinite(covariance), covariance, np.nan).reshape(-1, 6, 6)
    position = (R @ full[:, :3, :3] @ np.swapaxes(R, 1, 2))[:, :2, :2]
    turn = (R @ full[:, 3:, 3:] @ np.swapaxes(R, 1, 2))[:, 2, 2]
    told: NDArray[np.bool_] = np.asarray(np.isfinite(position).all(axis=(1, 2)))
    told[told] = np.linalg.eigvalsh(position[told])[:, 0] > 0.0
    out[told, :2, :2] = position[told]
    told = np.isfinite(turn) & (turn > 0.0)  # a reflector has a place and no heading
    out[told, 2, 2] = turn[told]
    return out
