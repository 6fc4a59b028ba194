"""The whole of hindsight: scans, odometry and map in, trajectory and changes out.

It reads neither the recorded belief nor an initial pose: a robot that was lost all along is found.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.scans import ScanSet, scan_set
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import planar_from_gtsam
from slamreplay.hindsight.beams import Beams, beams_of
from slamreplay.hindsight.carry import carry, scan_scores, settle
from slamreplay.hindsight.chain import Chain, scan_matched
from slamreplay.hindsight.changes import find_changes
from slamreplay.hindsight.keyframes import keyframes
from slamreplay.hindsight.places import (
    JUMP_BROKEN,
    JUMP_DOUBTFUL,
    JUMP_SOLID,
    best_places,
)
from slamreplay.hindsight.search import hypotheses_of
from slamreplay.hindsight.seating import seat_keyframes
from slamreplay.hindsight.smoothing import smooth
from slamreplay.hindsight.submaps import Submap, submaps
from slamreplay.hindsight.trust import trusted_keyframes
from slamreplay.matching.field import WorkingMap, working_map
from slamreplay.matching.whole_map import search_space

SIGMA_M = 0.12

Progress = Callable[[str, float], None]


def hindsight(view: BundleView, *, progress: Progress | None = None) -> Hindsight | None:
    """Where the robot really was, from scans, odometry and map alone.

    Args:
        view: the evidence.
        progress: told the step and its share done, 0 to 1.

    Returns:
        None without a map (or one without a single wall) or without scans.
    """
    say = progress or (lambda _step, _share: None)
    scans = scan_set(view)
    grid = view.grid
    working = None if grid is None else working_map(grid)
    if scans is None or grid is None or working is None:
        return None
    beams = beams_of(scans)
    base = view.manifest.frames.base or "base_link"
    say("keyframes", 0.0)
    odometry = odometry_at(scans, beams)
    keys = keyframes(beams, odometry)
    if not len(keys):
        return _nowhere(grid.frame_id, base, beams)
    points = [beams.points(k) for k in keys]
    say("scan matching", 0.05)
    chain = scan_matched(points, odometry[keys])
    found = submaps(chain, points, beams.laser_xy)
    if not found:
        return _nowhere(grid.frame_id, base, beams)
    field = working.field(SIGMA_M)
    space = search_space(working, field)
    motions, is_break = _between_submaps(chain, found)
    hypotheses = hypotheses_of(
        space,
        working,
        found,
        motions,
        is_break,
        lambda share: say("places on the map", 0.3 + 0.4 * share),
    )
    places = best_places(hypotheses, motions, _jump_costs(chain, found))
    start, is_open = seat_keyframes(field, points, chain, found, places)
    say("pose graph", 0.7)
    poses, cov = smooth(field, points, start, chain, is_open)
    say("every scan", 0.8)
    key_beams = Beams(beams.t_ns[keys], beams.ends[keys], beams.kind[keys], beams.laser_xy)
    trusted = trusted_keyframes(places, chain, is_open, cov, scan_scores(field, key_beams, poses))
    carried, share = carry(odometry, keys, poses, is_open, beams, field)
    carried, scan_cov = settle(carried, cov[share], odometry, keys[share], beams, field)
    carried[~trusted[share]], scan_cov[~trusted[share]] = np.nan, np.nan
    match = scan_scores(field, beams, carried)
    say("changes", 0.85)
    changes = find_changes(grid, working, beams, carried)
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
    )


def odometry_at(scans: ScanSet, beams: Beams) -> se2.Array:
    """(N, 3) odometry at each scan; where the log has none, by matching scan to scan.

    Before the first odometry sample, after the last and in gaps the robot is taken to stand; the
    keyframes' own scan matching finds out where it did not.
    """
    track = scans.odometry
    if track is not None and track.has_pose.any():
        poses = track.at(scans.t_ns, max_gap_ns=10_000_000_000).xyyaw.copy()
        known = np.flatnonzero(np.isfinite(poses).all(axis=1))
        if len(known):
            before = np.searchsorted(known, np.arange(len(poses)), side="right") - 1
            return np.asarray(poses[known[np.maximum(before, 0)]])
    return scan_matched([beams.points(k) for k in range(len(beams))], None).xyyaw


def _between_submaps(chain: Chain, found: list[Submap]) -> tuple[se2.Array, NDArray[np.bool_]]:
    reference = np.array([s.reference for s in found])
    motions = se2.between(chain.xyyaw[reference[:-1]], chain.xyyaw[reference[1:]])
    broken = np.cumsum(chain.is_break)
    return motions, np.asarray(broken[reference[1:]] > broken[reference[:-1]])


def _nowhere(frame: str, base: str, beams: Beams) -> Hindsight:
    n = len(beams)
    track = PoseTrack.without_covariance(frame, base, beams.t_ns, np.full((n, 3), np.nan))
    return Hindsight(track, float("nan"), 0.0, np.full(n, np.nan), None, None)


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
    return PoseTrack(frame, base, t_ns, in_map, planar_from_gtsam(cov, working.origin_xyyaw[2]))
