"""Particles and plans of a scene, brought into the map frame."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import BundleView
from slamreplay.consistency.evidence.clouds import sound_particles
from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.scene import SceneClouds, ScenePlans
from slamreplay.evidence.scene_scans import chosen
from slamreplay.geometry import se2, se3
from slamreplay.geometry.transforms import clean_frame

#: Where there may not be all: particles of one cloud, points of one plan.
MOST_PARTICLES, MOST_POINTS = 300, 100


def scene_clouds(post: Postmortem, view: BundleView, most: int | None) -> SceneClouds | None:
    """The localizer's particles; None where none were recorded in a frame that can be placed.

    Of a large cloud some are drawn in proportion to their weights (systematic resampling, Kitagawa
    1996, without the random start), so that what is shown lies as the whole does.

    Args:
        post: what was found.
        view: the log.
        most: clouds at the most; None for all of them, whole.
    """
    times, clouds = [], []
    for table, row, frame in _placed(post, view, "particles", most):
        particles, share = sound_particles(table["xyyaw"][row], table["weights"][row])
        if most is not None and len(particles) > MOST_PARTICLES:
            at = (np.arange(MOST_PARTICLES) + 0.5) / MOST_PARTICLES
            particles = particles[np.minimum(np.searchsorted(np.cumsum(share), at), len(share) - 1)]
        times.append(int(table.t_ns[row]))
        clouds.append(se2.compose(frame, particles).astype(np.float32))
    if not clouds:
        return None
    return SceneClouds(_times(times), _firsts(clouds), np.concatenate(clouds))


def scene_plans(post: Postmortem, view: BundleView, most: int | None) -> ScenePlans | None:
    """What the planner sent; None where nothing was recorded in a frame that can be placed.

    Args:
        post: what was found.
        view: the log.
        most: plans at the most; None for all of them with every point.
    """
    times, plans = [], []
    for table, row, frame in _placed(post, view, "plan", most):
        xy = table["xyyaw"][row].reshape(-1, 3)[:, :2]
        xy = xy[np.isfinite(xy).all(axis=1)]
        if most is not None and len(xy) > MOST_POINTS:
            xy = xy[np.linspace(0, len(xy) - 1, MOST_POINTS).astype(np.int64)]
        times.append(int(table.t_ns[row]))
        plans.append(se2.transform_points(frame, xy).astype(np.float32))
    if not plans:
        return None
    return ScenePlans(_times(times), _firsts(plans), np.concatenate(plans))


def _placed(
    post: Postmortem, view: BundleView, role: str, most: int | None
) -> Iterator[tuple[Table, int, se2.Array]]:
    """Rows of a role by time, at most so many, each with where its frame lies in the map (3,)."""
    table = view.role(role)
    if table is None:
        return
    order = np.argsort(table.t_ns, kind="stable")
    for row in order[chosen(table.t_ns[order], (), most)].tolist():
        frame = _frame_on_map(post, view, table, row)
        if frame is not None:
            yield table, row, frame


def _frame_on_map(post: Postmortem, view: BundleView, table: Table, row: int) -> se2.Array | None:
    """(3,) the frame of a row's numbers in the map at its time; None where tf does not tell."""
    frame = clean_frame(str(table["frame_id"][row]))
    own = view.manifest.frames.map or "map"
    if frame in (own, "" if view.grid is None else clean_frame(view.grid.frame_id)):
        return post.on_map(np.zeros(3))
    if not view.transforms.has_path(own, frame):
        return None
    T, valid = view.transforms.lookup(own, frame, table.t_ns[[row]])
    return post.on_map(se3.planar(T)[0]) if valid[0] else None


def _times(t_ns: list[int]) -> NDArray[np.int64]:
    return np.array(t_ns, dtype=np.int64)


def _firsts(parts: list[NDArray[np.float32]]) -> NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum([len(part) for part in parts])]).astype(np.int64)
