"""The whole of hindsight: scans, odometry and map in, trajectory and changes out.

It reads neither the recorded belief nor an initial pose: a robot that was lost all along is found.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.map_course import MapStretch
from slamreplay.bundle.met import BeamsMet
from slamreplay.bundle.products import Changes, Hindsight, Part
from slamreplay.bundle.scans import ScanSet, scan_sets
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import turned
from slamreplay.hindsight.beams import Beams, interleaved
from slamreplay.hindsight.bridging import bridged
from slamreplay.hindsight.carry import carry, scan_scores, settle
from slamreplay.hindsight.chain import Chain, torn_links
from slamreplay.hindsight.changes import find_changes
from slamreplay.hindsight.earlier import Earlier, earlier_versions
from slamreplay.hindsight.heirs import with_heirs
from slamreplay.hindsight.joined import joined, nowhere
from slamreplay.hindsight.laid import laid_out
from slamreplay.hindsight.places import (
    JUMP_BROKEN,
    JUMP_DOUBTFUL,
    JUMP_SOLID,
)
from slamreplay.hindsight.pooling import pooled
from slamreplay.hindsight.reseating import reseated
from slamreplay.hindsight.scale import map_scale
from slamreplay.hindsight.search import hypotheses_of
from slamreplay.hindsight.seating import seat_keyframes
from slamreplay.hindsight.sensing import sensed
from slamreplay.hindsight.smoothing import smooth
from slamreplay.hindsight.submaps import Submap, submaps
from slamreplay.hindsight.trust import keyframe_leads, trusted_keyframes
from slamreplay.hindsight.witnessed import witnessed_places
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.matching.field import ScoreField, WorkingMap, working_map
from slamreplay.matching.whole_map import search_space

SIGMA_M = 0.12
#: A second laser that the map explains this much worse than the first is left out.
MISFIT = 0.8
#: Where two lasers together place less of the scans than this, the first one is asked alone.
_BOTH_KNOW = 0.5

Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class _Drawn:
    """The map: as it was drawn, as it is searched, and whether a corrected one is asked for.

    `earlier` are the versions of the same place that held before it.
    """

    grid: OccupancyGrid
    working: WorkingMap
    correct_map: bool
    earlier: tuple[Earlier, ...] = ()


def hindsight(
    view: BundleView, *, correct_map: bool = False, progress: Progress | None = None
) -> Hindsight | None:
    """Where the robot really was, from scans, odometry and map alone.

    Where the log was given a map of another place on the way, each stretch is rebuilt in its own
    map and the results are joined.

    Args:
        view: the evidence.
        correct_map: propose a corrected map, too: of the one at the end.
        progress: told the step and its share done, 0 to 1.

    Returns:
        None without a map (or one without a single wall) or without scans.
    """
    say = progress or (lambda _step, _share: None)
    stretches = view.map_stretches
    if len(stretches) < 2:
        return _in_one_place(view, say, correct_map=correct_map)
    found = []
    for k, stretch in enumerate(stretches):
        part = view.within(stretch)
        share = partial(_share_of, say, k, len(stretches))
        correct = correct_map and k == len(stretches) - 1
        found.append(_in_one_place(part, share, correct_map=correct))
    grid = view.grid
    if grid is None or all(part is None for part in found):
        return None
    frames = view.manifest.frames
    frame, base = frames.map or "map", frames.base or "base_link"
    parts = [
        Part(stretch, nowhere(frame, base, _scan_times(view, stretch)) if part is None else part)
        for stretch, part in zip(stretches, found, strict=True)
    ]
    return joined(parts, frame, grid.cells.shape)


def _scan_times(view: BundleView, stretch: MapStretch) -> NDArray[np.int64]:
    scans = view.within(stretch).role("scan")
    return np.zeros(0, dtype=np.int64) if scans is None else np.sort(scans.t_ns)


def _share_of(say: Progress, done: int, count: int, step: str, share: float) -> None:
    """A share of one of several rounds, told as that of all of them."""
    say(step, (done + share) / count)


def _in_one_place(view: BundleView, say: Progress, *, correct_map: bool) -> Hindsight | None:
    """Hindsight in maps that are all of one place."""
    lasers = scan_sets(view)
    grid = view.grid
    working = None if grid is None else working_map(grid)
    if not lasers or grid is None or working is None:
        return None
    base = view.manifest.frames.base or "base_link"
    drawn = _Drawn(grid, working, correct_map, earlier_versions(view))
    whole = _rebuilt(view, base, drawn, lasers, say)
    if whole is not None and (len(lasers) == 1 or whole.coverage >= _BOTH_KNOW):
        return whole
    alone = _rebuilt(view, base, drawn, lasers[:1], say)
    return alone if whole is None or (alone and alone.coverage > whole.coverage) else whole


def _rebuilt(
    view: BundleView,
    base: str,
    drawn: _Drawn,
    lasers: Sequence[ScanSet],
    say: Progress,
) -> Hindsight | None:
    """Hindsight from these lasers; None where the map explains the second far worse."""
    say("keyframes", 0.0)
    grid, working = drawn.grid, drawn.working
    laid = laid_out(base, lasers, lambda: say("scan matching", 0.05))
    motion, each, beams, odometry = laid.motion, laid.each, laid.beams, laid.odometry
    keys, points, chain = laid.keys, laid.points, laid.chain
    if not len(keys):
        return nowhere(grid.frame_id, base, beams.t_ns)
    found = submaps(chain, points, beams.laser_xy)
    if not found:
        return nowhere(grid.frame_id, base, beams.t_ns)
    field = working.field(SIGMA_M)
    space = search_space(working, field)
    motions, is_break = _between_submaps(chain, found)
    jump_costs = _jump_costs(chain, found)
    hypotheses = hypotheses_of(
        space,
        working,
        found,
        motions,
        is_break,
        jump_costs == JUMP_SOLID,
        lambda share: say("places on the map", 0.3 + 0.4 * share),
    )
    hypotheses = with_heirs(space, working, found, hypotheses, motions, jump_costs)
    other = sensed(view, motion, beams.t_ns[keys], chain.xyyaw, se2.inverse(working.origin_xyyaw))
    places = witnessed_places(hypotheses, motions, jump_costs, chain, found, other)
    start, is_open = seat_keyframes(field, points, chain, found, places)
    say("pose graph", 0.7)
    poses, cov = smooth(field, points, start, chain, is_open, other)
    key_beams = Beams(beams.t_ns[keys], beams.ends[keys], beams.kind[keys], beams.laser_xy)
    key_scores = scan_scores(field, key_beams, poses)
    typical = float(np.median(places.score))
    again = reseated(space, points, poses, chain, is_open, key_scores, typical)
    if again is not None:
        poses, cov = smooth(field, points, again[0], chain, again[1], other)
        is_open, key_scores = again[1], scan_scores(field, key_beams, poses)
    say("every scan", 0.8)
    lead = keyframe_leads(places, found, len(keys))
    trusted = trusted_keyframes(places, chain, is_open, cov, key_scores, lead)
    if laid.is_told:
        told = odometry[keys]
        back = bridged(poses, cov, is_open, trusted, told, torn_links(chain, told))
        poses, cov, is_open, trusted = back.xyyaw, back.cov, back.is_open, back.has_place
    carried, share, doubt = carry(odometry, keys, poses, is_open, beams, field)
    carried, scan_cov = settle(carried, cov[share], odometry, keys[share], doubt, beams, field)
    unplaced = ~trusted[share] | ~laid.is_held
    carried[unplaced], scan_cov[unplaced] = np.nan, np.nan
    match = scan_scores(field, beams, carried)
    if len(each) > 1 and _second_misfits(field, each, carried, motion):
        return None
    say("changes", 0.85)
    changes = _changes(drawn, each, carried, motion)
    say("changes", 1.0)
    track = _to_track(working, grid.frame_id, base, beams.t_ns, carried, scan_cov)
    sigma = np.sqrt(0.5 * (scan_cov[:, 0, 0] + scan_cov[:, 1, 1]))
    has_pose = track.has_pose
    return Hindsight(
        track,
        float(np.median(sigma[has_pose])) if has_pose.any() else float("nan"),
        float(has_pose.mean()),
        match,
        places.margin,
        changes,
        {} if other is None else other.joined(),
        np.where(laid.is_held, lead[share], 0.0),
        map_scale(space, found, places),
    )


def _second_misfits(
    field: ScoreField, each: list[Beams], poses: se2.Array, motion: PoseTrack
) -> bool:
    """Whether the second laser sees another world than the map shows and the first one meets.

    A safety laser near the floor sees pallets and feet of chairs in a map that was drawn at the
    height of the first; all it would add is a worse place.
    """
    both, both_poses, is_first = interleaved(each[0], each[1], poses, motion)
    scores = scan_scores(field, both, both_poses)
    ours, theirs = scores[is_first], scores[~is_first]
    if not (np.isfinite(ours).any() and np.isfinite(theirs).any()):
        return False
    return bool(np.nanmedian(theirs) < MISFIT * np.nanmedian(ours))


def _changes(drawn: _Drawn, each: list[Beams], poses: se2.Array, motion: PoseTrack) -> Changes:
    """Changes seen by all lasers; the shares are pooled at the first one's scans."""
    look = partial(
        find_changes,
        drawn.grid,
        drawn.working,
        earlier=drawn.earlier,
        correct_map=drawn.correct_map,
    )
    if len(each) == 1:
        return look(each[0], poses)
    both, both_poses, is_first = interleaved(each[0], each[1], poses, motion)
    found = look(both, both_poses)
    return replace(
        found,
        t_ns=found.t_ns[is_first],
        changed_share=pooled(both, is_first, found.changed_share),
        appeared_share=pooled(both, is_first, found.appeared_share),
        removed_share=pooled(both, is_first, found.removed_share),
        met=tuple(
            BeamsMet(met.t_ns[rows], met.met[rows, : one.kind.shape[1]].copy())
            for met in found.met
            for rows, one in zip((is_first, ~is_first), each, strict=True)
        ),
    )


def _between_submaps(chain: Chain, found: list[Submap]) -> tuple[se2.Array, NDArray[np.bool_]]:
    reference = np.array([s.reference for s in found])
    motions = se2.between(chain.xyyaw[reference[:-1]], chain.xyyaw[reference[1:]])
    broken = np.cumsum(chain.is_break)
    return motions, np.asarray(broken[reference[1:]] > broken[reference[:-1]])


def _jump_costs(chain: Chain, found: list[Submap]) -> se2.Array:
    reference = np.array([s.reference for s in found])
    costs = np.full(len(found) - 1, JUMP_SOLID)
    for bad, cost in ((~chain.is_solid, JUMP_DOUBTFUL), (chain.is_break, JUMP_BROKEN)):
        count = np.cumsum(bad)
        costs[count[reference[1:]] > count[reference[:-1]]] = cost
    return costs


def _to_track(
    working: WorkingMap,
    frame: str,
    base: str,
    t_ns: NDArray[np.int64],
    poses: se2.Array,
    cov: se2.Array,
) -> PoseTrack:
    """Out of the grid's frame: its origin's yaw turns poses and covariances."""
    in_map = np.where(np.isfinite(poses), working.to_map(poses), np.nan)
    return PoseTrack(frame, base, t_ns, in_map, turned(cov, working.origin_xyyaw[2]))
