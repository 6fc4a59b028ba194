"""What of a post-mortem is shown by other tools: one window of it, in the map frame of its end.

Both writers for viewers draw from this, so that they show the same at the same moments.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from slamreplay.bundle.products import ChangedRegion
from slamreplay.bundle.run import Run
from slamreplay.bundle.scans import scan_sets
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.scene import Lane, Scene, SceneClouds, ScenePlans, SceneScans
from slamreplay.evidence.scene_paths import scene_clouds, scene_plans
from slamreplay.evidence.scene_scans import scans_in_pieces
from slamreplay.export.tum import trial_name
from slamreplay.geometry import se2
from slamreplay.geometry.times import Times
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.verdict.judgement import Interval, Stop

#: Frames of the two robots. No robot has frames of these names, so that the log itself can be open
#: beside the export.
BASE_BELIEVED, BASE_HINDSIGHT = "base_believed", "base_hindsight"


@dataclass(frozen=True, eq=False)
class Shown:
    """What lies in the window.

    Attributes:
        frame_id: of the map.
        start_ns: first moment that is written.
        end_ns: last moment that is written.
        place_ns: from here on the log is in the place of its last map; before, poses of the map
            frame mean something else and are not written.
        belief: believed poses, None without any.
        hindsight: poses of hindsight, None without any.
        runs: name and poses of every run that has an estimate, in the frame of that estimate.
        maps: from when on which map held, the first one from `place_ns` on.
        regions: changed regions in the last map, by the time they were first seen.
        stops: unplanned stops whose place is known, with their numbers on the report's page.
        states: the log's states, cut at the window.
        scene: what there was to see, None where nobody asked.
        lasers: by laser what it saw, piece by piece, all of its scans; nothing without a scene.
    """

    post: Postmortem
    frame_id: str
    start_ns: int
    end_ns: int
    place_ns: int
    belief: PoseTrack | None
    hindsight: PoseTrack | None
    runs: tuple[tuple[str, PoseTrack], ...]
    maps: tuple[tuple[int, OccupancyGrid], ...]
    regions: tuple[ChangedRegion, ...]
    stops: tuple[tuple[int, Stop], ...]
    states: tuple[Interval, ...]
    scene: Scene | None
    lasers: tuple[Callable[[], Iterator[SceneScans]], ...]

    def has(self, t_ns: int) -> bool:
        """Whether a moment lies in the window."""
        return self.start_ns <= t_ns <= self.end_ns

    def rows(self, t_ns: Times, *, in_place: bool = True) -> slice:
        """Rows of ascending times (N,) in the window; of places only since `place_ns`."""
        low = max(self.start_ns, self.place_ns) if in_place else self.start_ns
        first = int(np.searchsorted(t_ns, low))
        return slice(first, max(first, int(np.searchsorted(t_ns, self.end_ns, side="right"))))

    @property
    def lanes(self) -> tuple[Lane, ...]:
        """The scene's lanes in the window."""
        lanes = () if self.scene is None else self.scene.lanes
        cut = [(lane, self.rows(lane.t_ns, in_place=False)) for lane in lanes]
        return tuple(replace(a, t_ns=a.t_ns[rows], values=a.values[rows]) for a, rows in cut)

    @property
    def clouds(self) -> SceneClouds | None:
        """The scene's particles; their rows are cut where they are read."""
        return None if self.scene is None else self.scene.clouds

    @property
    def plans(self) -> ScenePlans | None:
        """The scene's plans, likewise."""
        return None if self.scene is None else self.scene.plans


def shown(
    post: Postmortem,
    view: BundleView,
    *,
    runs: Sequence[Run] = (),
    start_ns: int | None = None,
    end_ns: int | None = None,
) -> Shown:
    """The window [start_ns, end_ns] of a post-mortem; by default the whole log."""
    first, last = post.manifest.start_ns, post.manifest.end_ns
    start_ns = first if start_ns is None else max(start_ns, first)
    end_ns = last if end_ns is None else min(end_ns, last)
    place_ns = max(post.drawn_from_ns, start_ns)
    seeds = {run.trial.seed for run in runs}
    tracks = [
        (trial_name(run.trial, with_seed=len(seeds) > 1), run.estimate.track)
        for run in runs
        if run.estimate is not None
    ]
    scene = post.scene
    if scene is not None:  # a page shows some of these, a tool that can take its time all of them
        scene = replace(
            scene,
            clouds=scene_clouds(post, view, None) or scene.clouds,
            plans=scene_plans(post, view, None) or scene.plans,
        )
    hindsight = post.hindsight
    changes = None if hindsight is None else hindsight.changes
    regions = () if changes is None else changes.regions
    return Shown(
        post=post,
        frame_id=post.manifest.frames.map or "map",
        start_ns=start_ns,
        end_ns=end_ns,
        place_ns=place_ns,
        belief=_cut(post.belief_on_map, place_ns, end_ns),
        hindsight=None if hindsight is None else _cut(hindsight.track, place_ns, end_ns),
        runs=tuple(
            (name, cut) for name, t in tracks if (cut := _cut(t, start_ns, end_ns)) is not None
        ),
        maps=_maps(post, view, place_ns, end_ns),
        regions=tuple(
            sorted(
                (r for r in regions if r.map_version is None and r.first_seen_ns <= end_ns),
                key=lambda r: r.first_seen_ns,
            )
        ),
        stops=tuple(
            (number, stop)
            for number, stop in enumerate(post.judgement.stops, start=1)
            if stop.x_m is not None and stop.y_m is not None and place_ns <= stop.t_ns <= end_ns
        ),
        states=tuple(
            replace(i, start_ns=max(i.start_ns, start_ns), end_ns=min(i.end_ns, end_ns))
            for i in post.judgement.intervals
            if i.start_ns <= end_ns and i.end_ns > start_ns
        ),
        scene=scene,
        lasers=_lasers(post, view, place_ns, end_ns),
    )


def poses_at(track: PoseTrack, t_ns: Times) -> se2.Array:
    """(M, 3) poses at other times (M,); NaN where a row of the track beside it has none, too."""
    after = np.searchsorted(track.t_ns, t_ns)
    before = np.searchsorted(track.t_ns, t_ns, side="right") - 1
    inside = (before >= 0) & (after < len(track))
    known = np.zeros(len(t_ns), dtype=bool)
    has_pose = track.has_pose
    known[inside] = has_pose[before[inside]] & has_pose[after[inside]]
    return np.where(known[:, None], track.at(t_ns).xyyaw, np.nan)


def _cut(track: PoseTrack | None, start_ns: int, end_ns: int) -> PoseTrack | None:
    """The rows with a time in the window, by time; None where none has a pose."""
    if track is None:
        return None
    rows = np.flatnonzero((track.t_ns >= start_ns) & (track.t_ns <= end_ns))
    cut = track.take(rows[np.argsort(track.t_ns[rows], kind="stable")])
    return cut if cut.has_pose.any() else None


def _lasers(
    post: Postmortem, view: BundleView, start_ns: int, end_ns: int
) -> tuple[Callable[[], Iterator[SceneScans]], ...]:
    """What each laser of the scene saw; of scans that the scene left out, too."""
    found: list[Callable[[], Iterator[SceneScans]]] = []
    every = () if post.scene is None else scan_sets(view)
    for number, scans in enumerate(() if post.scene is None else post.scene.scans):
        if number < len(every) and len(every[number]) > len(scans.t_ns):
            t_ns = every[number].t_ns
            rows = slice(
                int(np.searchsorted(t_ns, start_ns)),
                int(np.searchsorted(t_ns, end_ns, side="right")),
            )
            found.append(partial(scans_in_pieces, post, view, number, rows))
        else:
            found.append(partial(iter, (scans,)))
    return tuple(found)


def _maps(
    post: Postmortem, view: BundleView, place_ns: int, end_ns: int
) -> tuple[tuple[int, OccupancyGrid], ...]:
    if post.grid is None or not view.map_stretches:
        return ()
    found = []
    for held in view.map_stretches[-1].held:
        grid = view.grid_of(held.version)
        if grid is not None and held.end_ns > place_ns and held.start_ns <= end_ns:
            found.append((max(held.start_ns, place_ns), grid))
    return tuple(found)
