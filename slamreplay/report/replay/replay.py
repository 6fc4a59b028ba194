"""Everything the replay shows, as one payload, and what had to be left out of it in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.track import PoseTrack
from slamreplay.evidence.result import Postmortem
from slamreplay.evidence.scene import Lane, Scene
from slamreplay.report.figures.canvas import thinned
from slamreplay.report.replay import head, words
from slamreplay.report.replay.beams import PackedScans, packed_scans
from slamreplay.report.replay.ground import Ground, ground_of
from slamreplay.report.replay.overlays import Overlay, packed_clouds, packed_plans
from slamreplay.report.replay.packing import as_text, packed, short_floats
from slamreplay.report.replay.tracks import Ticks, known, packed_track

#: Deflated; a third more in the page. With the rest of it a page stays under 5 MB.
BUDGET_BYTES = 1_850_000
#: What share of it scans get at the least, however much the rest takes.
_LEAST_FOR_SCANS = 0.2
#: What is packed together is not as small as its parts say: times of scans are not in them.
_SPARE = 0.98
#: Samples of a lane beyond this are left out; every peak and every gap stays.
_MOST_SAMPLES = 6_000


@dataclass(frozen=True)
class Replay:
    """The replay of one log, as the template prints it.

    Attributes:
        payload: base64 of what `packing` describes.
        lead: what is to be seen, in a sentence.
        notes: what is shown and what was left out, in sentences.
        rows: so many rows of the timeline, and so many lanes: the page keeps room for them.
        shape: of the map: wide, tall, plain or none.
    """

    payload: str
    lead: str
    notes: tuple[str, ...]
    rows: int
    lanes: int
    shape: str


def replay_of(post: Postmortem, budget: int = BUDGET_BYTES) -> Replay | None:
    """The replay of a post-mortem; None without a scene, or where it has nothing to show.

    Args:
        post: with its scene.
        budget: bytes of the payload, deflated: scans and beams are thinned to keep it.
    """
    scene = post.scene
    if scene is None:
        return None
    tracks = _tracks(post)
    if not tracks and not scene.lanes and not scene.marks:
        return None
    ticks = Ticks.of(post.manifest.start_ns, post.manifest.end_ns)
    arrays: dict[str, NDArray] = {}
    first = next(iter(tracks.values()), None)
    origin = np.zeros(2) if first is None else np.round(first.xyyaw[first.has_pose][0, :2])
    every = {}
    for name, track in tracks.items():
        of_track, every[name] = packed_track(name, track, ticks, origin)
        arrays |= of_track
    for k, lane in enumerate(scene.lanes):
        arrays |= _lane(k, lane, ticks)
    overlays: list[tuple[str, Overlay]] = []
    ground: Ground | None = None
    if tracks and "odometry" not in tracks:
        if post.grid is not None:
            ground = ground_of(post.grid, None if not post.hindsight else post.hindsight.changes)
        clouds = None if scene.clouds is None else packed_clouds(scene.clouds, ticks, origin)
        plans = None if scene.plans is None else packed_plans(scene.plans, ticks, origin)
        overlays += [] if clouds is None else [("particles", clouds)]
        overlays += [] if plans is None else [("plans", plans)]
    for _name, overlay in overlays:
        arrays |= overlay.arrays
    if ground is not None:
        arrays["ground"] = ground.codes
    told = head.head_of(post, scene, tracks, ticks, origin, ground)
    rest = int(_SPARE * budget) - len(packed(told, arrays))
    scans = _scans(scene, tracks, max(rest, int(_LEAST_FOR_SCANS * budget)))
    for k, (of_laser, one) in enumerate(scans):
        arrays[f"scan{k}_t"] = ticks.at(scene.scans[of_laser].t_ns[one.rows])
        arrays[f"scan{k}_ends"], arrays[f"scan{k}_met"] = one.ends, one.met
    told["lasers"] = [scene.scans[of_laser].laser_xy.tolist() for of_laser, _ in scans]
    notes = words.notes(post, scans=[one for _, one in scans], overlays=overlays, ground=ground)
    return Replay(
        as_text(packed(told, arrays)),
        words.lead(tracks, has_scans=bool(scans)),
        (*notes, *words.rows_left_out(every)),
        len({mark.kind for mark in scene.marks}),
        len(scene.lanes),
        head.shape_of(told),
    )


def _tracks(post: Postmortem) -> dict[str, PoseTrack]:
    """What is drawn, in the map of the log's end; odometry where nothing better is known."""
    since = post.drawn_from_ns
    hindsight = None if post.hindsight is None else known(post.hindsight.track, since)
    belief = known(post.belief_on_map, since)
    found = {"belief": belief, "hindsight": hindsight}
    if belief is None and hindsight is None:
        found = {"odometry": known(post.odometry, post.manifest.start_ns)}
    return {name: track for name, track in found.items() if track is not None}


def _lane(k: int, lane: Lane, ticks: Ticks) -> dict[str, NDArray]:
    t, values = thinned(ticks.at(lane.t_ns).astype(np.float64), lane.values, _MOST_SAMPLES)
    return {f"lane{k}_t": t.astype(np.int32), f"lane{k}_v": short_floats(values)}


def _scans(
    scene: Scene, tracks: dict[str, PoseTrack], budget: int
) -> Sequence[tuple[int, PackedScans]]:
    """Of each laser with scans that can be placed: its number in the scene, and its scans."""
    found = []
    for k, scans in enumerate(scene.scans):
        placed = np.zeros(len(scans.t_ns), dtype=bool)
        for track in tracks.values():
            placed |= track.at(scans.t_ns).has_pose
        one = packed_scans(scans, placed, budget // len(scene.scans))
        found += [] if one is None else [(k, one)]
    return found
