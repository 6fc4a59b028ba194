"""The steps of hindsight by themselves: places, changes, evidence."""

from dataclasses import replace

import numpy as np
import pytest

from slamreplay.bundle.scans import ScanSet
from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2
from slamreplay.hindsight.beams import (
    HIT,
    INVALID,
    MISS,
    Beams,
    beams_of,
    interleaved,
    side_by_side,
)
from slamreplay.hindsight.chain import Chain
from slamreplay.hindsight.changes import find_changes
from slamreplay.hindsight.keyframes import keyframes, with_more
from slamreplay.hindsight.laid import motion_by_scans
from slamreplay.hindsight.places import (
    JUMP_DOUBTFUL,
    JUMP_SOLID,
    WEIGHT,
    Hypotheses,
    Places,
    best_places,
)
from slamreplay.hindsight.pooling import pooled
from slamreplay.hindsight.smoothing import floor_covariance
from slamreplay.hindsight.submaps import Submap
from slamreplay.hindsight.trust import keyframe_leads, trusted_keyframes
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.raycast import cast_rays
from slamreplay.matching.field import ScoreField, working_map

MOTION = np.array([[1.0, 0.0, 0.0]])


def places_of(first, second, jump_cost):
    def hypotheses(pairs):
        return Hypotheses(np.array([p for p, _ in pairs]), np.array([s for _, s in pairs]))

    return best_places([hypotheses(first), hypotheses(second)], MOTION, np.array([jump_cost]))


def test_motion_outvotes_a_slightly_better_place_elsewhere():
    first = [((0.0, 0.0, 0.0), 0.9)]
    second = [((9.0, 5.0, 2.0), 0.9), ((1.05, 0.0, 0.0), 0.8)]
    found = places_of(first, second, JUMP_SOLID)

    assert found.chosen.tolist() == [0, 1]
    assert not found.jumps[0]


@pytest.mark.parametrize(("cost", "jumps"), [(JUMP_DOUBTFUL, True), (JUMP_SOLID, False)])
def test_much_better_place_elsewhere_is_a_jump_where_motion_is_doubtful(cost, jumps):
    first = [((0.0, 0.0, 0.0), 0.9)]
    second = [((9.0, 5.0, 2.0), 0.9), ((1.05, 0.0, 0.0), 0.5)]

    assert places_of(first, second, cost).jumps.tolist() == [jumps]


def test_margin_is_the_lead_over_the_best_wholly_different_sequence():
    first = [((0.0, 0.0, 0.0), 0.9), ((0.1, 0.0, 0.0), 0.89), ((5.0, 5.0, 0.0), 0.7)]
    second = [((1.0, 0.0, 0.0), 0.9), ((6.0, 5.0, 0.0), 0.8)]
    found = places_of(first, second, JUMP_SOLID)

    assert found.margin == pytest.approx(0.15)
    np.testing.assert_allclose(found.doubt, [36.0, 36.0])


def test_without_another_place_there_is_no_margin():
    found = places_of([((0.0, 0.0, 0.0), 0.9)], [((1.0, 0.0, 0.0), 0.9)], JUMP_SOLID)

    assert found.margin is None
    assert np.isinf(found.doubt).all()


def two_submaps(second_lead: float) -> tuple[Places, list[Submap]]:
    poses = np.zeros((2, 3))
    doubt = WEIGHT * np.array([0.5, second_lead])
    places = Places(np.zeros(2, int), poses, np.full(2, 0.9), np.zeros(1, bool), 0.3, doubt)
    empty = np.empty((0, 2))
    return places, [Submap(0, 6, 3, empty, empty), Submap(6, 10, 8, empty, empty)]


@pytest.mark.parametrize(("second_lead", "known"), [(0.2, 10), (0.05, 6)])
def test_stretch_without_a_lead_over_other_places_is_not_placed(second_lead, known):
    places, found = two_submaps(second_lead)
    lead = keyframe_leads(places, found, 10)
    sure, ones = np.ones(10, bool), np.ones(10)
    chain = Chain(np.zeros((10, 3)), ones, ~sure, sure, np.zeros((10, 3, 3)))
    cov = np.broadcast_to(np.eye(3) * 1e-4, (10, 3, 3))

    trusted = trusted_keyframes(places, chain, np.zeros(9, bool), cov, ones, lead)

    np.testing.assert_allclose(lead, [0.5] * 6 + [second_lead] * 4)
    assert trusted.tolist() == [True] * known + [False] * (10 - known)


def test_pose_is_no_better_than_the_map_is_drawn():
    sigma_m = [
        np.sqrt(
            floor_covariance(ScoreField(np.zeros((2, 2), np.float32), cell_m, np.zeros(2)))[0, 0]
        )
        for cell_m in (0.02, 0.05, 0.1)
    ]

    np.testing.assert_allclose(sigma_m, [0.008, 0.008, 0.0286], atol=1e-3)


def hall() -> OccupancyGrid:
    """10 x 10 m with a wall across its upper part and unmapped ground on the right."""
    cells = np.zeros((200, 200), dtype=np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    cells[150:153, 20:120] = 100
    cells[:, 170:198] = -1
    return OccupancyGrid(cells, 0.05, np.array([1.0, -2.0, 0.3]))


POSE = np.array([4.0, 4.0, 0.2])  # in the grid's frame
BEARINGS = np.arange(0.0, 2.0 * np.pi, np.radians(2.0))


def beams_in(worlds: list[np.ndarray], max_range_m: float = 12.0) -> Beams:
    """One scan for each world (its cells) at 10 Hz from POSE."""
    reach = np.array(
        [
            cast_rays(OccupancyGrid(c, 0.05, np.zeros(3)), POSE, BEARINGS, max_range_m)[0]
            for c in worlds
        ]
    )
    kind = np.where(np.isfinite(reach), HIT, MISS).astype(np.int8)
    reach = np.where(np.isfinite(reach), reach, max_range_m)
    ends = np.stack([reach * np.cos(BEARINGS), reach * np.sin(BEARINGS)], axis=-1)
    t_ns = np.arange(len(worlds)) * 100_000_000
    return Beams(t_ns, ends.astype(np.float32), kind, np.zeros(2))


def changes_in(worlds: list[np.ndarray]):
    grid = hall()
    poses = np.tile(POSE, (len(worlds), 1))
    return find_changes(grid, working_map(grid), beams_in(worlds), poses)


def with_box(low, high) -> np.ndarray:
    cells = hall().cells.copy()
    cells[low[1] : high[1], low[0] : high[0]] = 100
    return cells


def test_box_that_stands_is_a_change_and_is_where_it_stands():
    found = changes_in([with_box((40, 40), (60, 50))] * 60)

    assert found.appeared_share.min() > 0.03
    assert found.removed_share.max() == 0.0
    (region,) = found.regions
    assert region.kind == "appeared"
    assert region.views == 60
    rows, cols = np.nonzero(found.appeared)
    assert (rows.min(), cols.max()) >= (38, 58)
    centre = hall().centre_of(np.array([48, 50]))
    assert region.bbox_m[0] < centre[0] < region.bbox_m[2]


def test_box_that_stands_too_short_or_keeps_moving_is_no_change():
    moving = [with_box((40 + k, 40), (50 + k, 50)) for k in range(60)]
    brief = [with_box((40, 40), (60, 50))] * 20 + [hall().cells] * 60

    for worlds in (moving, brief):
        found = changes_in(worlds)
        assert np.nanmax(found.appeared_share) < 0.02
        assert found.regions == ()


def test_wall_that_is_gone_is_a_change():
    cells = hall().cells.copy()
    cells[150:153, 20:120] = 0
    found = changes_in([cells] * 60)

    assert found.removed_share.min() > 0.05
    assert {r.kind for r in found.regions} == {"removed"}
    assert found.removed[151, 40:110].mean() > 0.5
    assert not found.appeared.any()


def test_what_stands_on_unmapped_ground_is_unchanged():
    found = changes_in([with_box((175, 60), (185, 100))] * 60)

    assert found.changed_share.max() == 0.0


KNOWN = np.zeros(10, dtype=bool)
HELD = ~KNOWN


def test_carried_robot_gets_keyframes_although_its_wheels_stand():
    near, far = hall().cells, with_box((20, 20), (120, 75))
    beams = beams_in([near] * 5 + [far] * 5)

    assert keyframes(beams, np.zeros((10, 3)), KNOWN, HELD).tolist() == [0, 5]


def test_motion_makes_keyframes():
    beams = beams_in([hall().cells] * 10)
    odometry = np.column_stack([np.arange(10) * 0.1, np.zeros(10), np.zeros(10)])

    assert keyframes(beams, odometry, KNOWN, HELD).tolist() == [0, 3, 6, 9]
    assert keyframes(beams, odometry * 0.0, KNOWN, HELD).tolist() == [0]


def test_unknown_motion_has_a_keyframe_on_either_side():
    beams = beams_in([hall().cells] * 10)

    assert keyframes(beams, np.zeros((10, 3)), np.arange(10) == 6, HELD).tolist() == [0, 5, 6]


def test_link_that_odometry_missed_gets_more_keyframes():
    beams = beams_in([hall().cells] * 3 + [with_box((20, 20), (40, 60))] * 3)
    keys = np.array([0, 5])

    assert with_more(beams, keys, np.array([True])).tolist() == [0, 3, 5]
    assert with_more(beams, keys, np.array([False])).tolist() == [0, 5]


def test_without_odometry_a_gap_in_the_scans_is_a_break():
    beams = beams_in([hall().cells] * 6)
    beams = replace(beams, t_ns=np.array([0, 1, 2, 40, 41, 42]) * 100_000_000)

    track, is_unknown, is_held = motion_by_scans("base", beams)

    assert is_unknown.tolist() == [False, False, False, True, False, False]
    assert is_held.all()
    assert np.abs(track.xyyaw).max() < 0.02


@pytest.mark.parametrize("is_bare", [True, False])
def test_without_odometry_scans_between_bare_walls_are_not_held(is_bare):
    """A robot drives along x, 1 m/s, between two walls that its laser sees no end of."""
    cells = np.zeros((80, 800), dtype=np.int8)
    cells[[20, 60]] = 100
    if not is_bare:  # cupboards
        for col in range(0, 800, 60):
            cells[20:34, col : col + 14] = 100
    walls = OccupancyGrid(cells, 0.05, np.zeros(3))
    at = np.column_stack([np.arange(15.0, 19.0, 0.1), np.full(40, 2.1), np.zeros(40)])
    bearings = np.radians(np.arange(0.0, 360.0, 2.0))
    rng = np.random.Generator(np.random.PCG64(4))
    reach = cast_rays(walls, at, bearings, 8.0)
    kind = np.where(np.isfinite(reach), HIT, MISS).astype(np.int8)
    reach = np.where(kind == HIT, reach, 8.0) + rng.normal(0.0, 0.01, reach.shape)
    ends = np.stack([reach * np.cos(bearings), reach * np.sin(bearings)], axis=-1)
    beams = Beams(np.arange(40) * 100_000_000, ends.astype(np.float32), kind, np.zeros(2))

    _, is_unknown, is_held = motion_by_scans("base", beams)

    assert is_held.mean() == (0.0 if is_bare else 1.0)
    assert len(keyframes(beams, at, is_unknown, is_held)) == (0 if is_bare else 14)


def laser(t_s: list[float], x: float, ends: list[tuple[float, float]]) -> Beams:
    """Scans of two hits each, in the base frame, of a laser at (x, 0)."""
    t_ns = (np.array(t_s) * 1e9).astype(np.int64)
    same = np.tile(np.array(ends, dtype=np.float32), (len(t_s), 1, 1))
    return Beams(t_ns, same, np.full(same.shape[:2], HIT, np.int8), np.array([x, 0.0]))


def driving() -> PoseTrack:
    """1 m/s along x."""
    t_s = np.arange(0.0, 10.0, 0.5)
    xyyaw = np.column_stack([t_s, 0.0 * t_s, 0.0 * t_s])
    return PoseTrack.without_covariance("odom", "base", (t_s * 1e9).astype(np.int64), xyyaw)


def test_second_laser_lies_beside_the_first_at_its_time():
    front = laser([1.0, 2.0], 0.2, [(2.0, 0.0), (2.0, 1.0)])
    rear = laser([1.1, 2.4], -0.2, [(-2.0, 0.0), (-2.0, 1.0)])
    both = side_by_side(front, rear, driving())

    np.testing.assert_allclose(both.ends[0, 2:], [[-1.9, 0.0], [-1.9, 1.0]], atol=1e-6)
    assert (both.kind[0] == HIT).all()
    assert (both.kind[1, 2:] == INVALID).all()  # its nearest scan is 0.4 s away


def test_shares_are_pooled_by_beams_not_by_scans():
    kind = np.full((5, 4), HIT, dtype=np.uint8)
    kind[0, 1:] = INVALID  # one beam
    both = Beams(np.arange(5), np.zeros((5, 4, 2), np.float32), kind, np.zeros(2))
    is_first = np.array([False, True, True, False, False])

    share = pooled(both, is_first, np.array([1.0, 0.0, 0.5, np.nan, 0.25]))

    assert share == pytest.approx([1.0 / 5.0, (2.0 + 1.0) / 8.0])
    alone = pooled(both, np.ones(5, bool), np.array([0.1, 0.2, np.nan, 0.4, 0.5]))
    assert alone == pytest.approx([0.1, 0.2, np.nan, 0.4, 0.5], nan_ok=True)


def test_interleaved_rays_start_at_their_own_laser():
    front = laser([1.0, 2.0], 0.2, [(2.0, 0.0), (2.0, 1.0), (2.0, 2.0)])
    rear = laser([1.1], -0.2, [(-2.0, 0.0), (-2.0, 1.0)])
    poses = np.array([[5.0, 1.0, np.pi / 2], [5.0, 2.0, np.pi / 2]])
    both, both_poses, is_first = interleaved(front, rear, poses, driving())

    assert is_first.tolist() == [True, False, True]
    start = se2.transform_points(both_poses[1], both.laser_xy[None])[0]
    ends = se2.transform_points(both_poses[1], both.ends[1, :2])
    np.testing.assert_allclose(start, [5.0, 1.1 - 0.2], atol=1e-6)
    np.testing.assert_allclose(ends, [[5.0, -0.9], [4.0, -0.9]], atol=1e-6)
    assert both.kind[1].tolist() == [HIT, HIT, INVALID]


def test_beams_end_where_their_plain_twin_has_them_in_a_sweep_that_turns():
    rng = np.random.Generator(np.random.PCG64(2))
    n, width = 6, 40
    t_ns = np.arange(n) * 100_000_000
    track_ns = np.arange(0, 700_000_001, 10_000_000)
    steady = np.outer(track_ns / 1e9, [0.8, -0.2, 1.1])
    ranges = rng.uniform(0.5, 9.0, (n, width)).astype(np.float32)
    hits = rng.random((n, width)) < 0.8
    scans = ScanSet(
        t_ns,
        ranges,
        np.full(n, -1.5),
        np.full(n, 0.07),
        np.full(n, 0.1 / width),
        hits,
        np.zeros((n, width), dtype=bool),
        np.full(n, 10.0),
        np.array([0.2, 0.1, 0.3]),
        PoseTrack.without_covariance("odom", "base", track_ns, steady),
    )
    beams = beams_of(scans, scans.odometry)

    for k in range(n):
        np.testing.assert_allclose(beams.points(k), scans.points(k), atol=5e-3)
    still = beams_of(scans, None)
    assert np.abs(still.points(0) - beams.points(0)).max() > 0.1
