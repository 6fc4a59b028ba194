"""The verdict on logs whose truth is known, with hindsight made by hand."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from handmade import at_scans, hindsight_of, shares_between

from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.findings import FINDINGS
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle, BundleView
from slamreplay.geometry import se2, se3
from slamreplay.geometry.times import ns
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.testing.synthetic import START_NS, room_grid, synthetic_bundle, true_path
from slamreplay.verdict.actions import actions
from slamreplay.verdict.clearance import Obstacles, inscribed_radius_m
from slamreplay.verdict.gate import allows, ratio, sigma_towards
from slamreplay.verdict.judge import judge
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.stops import stops


def judged(bundle, hindsight=None, **settings):
    view = bundle.view()
    hindsight = hindsight_of(bundle) if hindsight is None else hindsight
    belief = recorded_belief(view, at_scans(bundle))
    judgement = judge(view, belief, hindsight, Limits(**settings))
    tiles = judgement.intervals
    assert (tiles[0].start_ns, tiles[-1].end_ns) == (view.manifest.start_ns, view.manifest.end_ns)
    assert all(a.end_ns == b.start_ns for a, b in pairwise(tiles))
    assert all(f.id in FINDINGS for f in judgement.findings)
    assert {i for t in tiles for i in t.findings} <= {f.id for f in judgement.findings}
    assert judgement.summary.count(". ") == 0
    assert judgement.summary.endswith(".")
    assert judgement.confidence is None or 0.0 <= judgement.confidence < 1.0
    return judgement


def spans(judgement):
    return [
        (i.state, round((i.start_ns - START_NS) / 1e9, 1), round((i.end_ns - START_NS) / 1e9, 1))
        for i in judgement.intervals
    ]


def ids(judgement):
    return [f.id for f in judgement.findings]


# --- states ----------------------------------------------------------------------------------


def test_healthy():
    judgement = judged(synthetic_bundle())

    assert (judgement.state, judgement.failure_mode.kind) == ("healthy", "none")
    assert spans(judgement) == [("healthy", 0.0, 20.0)]
    assert judgement.findings == ()
    assert judgement.confidence > 0.9


def test_lost_from_the_start():
    judgement = judged(synthetic_bundle(seconds=30, belief_offset_xyyaw=(1.5, 0.0, 0.6)))

    assert (judgement.state, judgement.failure_mode.kind) == ("lost", "wrong_initial_pose")
    assert spans(judgement) == [("lost", 0.0, 30.0)]
    assert judgement.intervals[0].max_error_m == pytest.approx(1.5, abs=0.1)
    assert "1.5 m" in judgement.summary or "1.6 m" in judgement.summary


def test_lost_from_a_moment_on():
    bundle = synthetic_bundle(belief_offset_xyyaw=(1.0, 0.5, 0.0), offset_from_s=8.0)
    judgement = judged(bundle)

    assert judgement.state == "lost"
    assert spans(judgement) == [("healthy", 0.0, 8.0), ("lost", 8.0, 20.0)]
    # Odometry and hindsight agree, the belief jumped on its own.
    assert judgement.failure_mode.kind == "association_error"
    assert "8.0 s" in judgement.failure_mode.evidence[0]


def test_a_heading_alone_can_be_lost():
    judgement = judged(synthetic_bundle(belief_offset_xyyaw=(0.0, 0.0, 0.5), offset_from_s=6.0))

    assert judgement.state == "lost"
    assert judgement.findings[0].unit == "rad"


@pytest.mark.parametrize(("offset_m", "state"), [(0.4, "healthy"), (0.6, "lost")])
def test_half_a_metre_is_the_limit(offset_m, state):
    bundle = synthetic_bundle(belief_offset_xyyaw=(offset_m, 0.0, 0.0), offset_from_s=5.0)

    assert judged(bundle).state == state


def test_changed_aisle_is_not_a_lost_robot():
    bundle = synthetic_bundle()
    judgement = judged(bundle, hindsight_of(bundle, shares=shares_between(bundle, 5, 12, 0.3)))

    assert (judgement.state, judgement.failure_mode.kind) == ("map_changed", "stale_map_use")
    assert spans(judgement)[1] == ("map_changed", 5.0, 12.0)
    assert ids(judgement) == ["SR-MAP-001"]
    assert "knew where it was" in judgement.summary


def test_lost_in_a_changed_aisle():
    bundle = synthetic_bundle(belief_offset_xyyaw=(1.0, 0.5, 0.0), offset_from_s=8.0)
    judgement = judged(bundle, hindsight_of(bundle, shares=shares_between(bundle, 5, 15, 0.3)))

    assert judgement.state == "lost_and_map_changed"
    assert [s for s, _, _ in spans(judgement)] == [
        "healthy", "map_changed", "lost_and_map_changed", "lost",
    ]  # fmt: skip


def test_share_of_eight_per_cent_is_the_limit_and_short_changes_are_people():
    bundle = synthetic_bundle()
    below = hindsight_of(bundle, shares=shares_between(bundle, 2, 18, 0.079))
    brief = hindsight_of(bundle, shares=shares_between(bundle, 2, 3.9, 0.5))

    assert judged(bundle, below).state == "healthy"
    assert spans(judged(bundle, brief)) == [("healthy", 0.0, 20.0)]


def test_without_belief_lost_is_not_judged_but_changes_are():
    bundle = synthetic_bundle(with_belief=False)
    calm = judged(bundle)
    changed = judged(bundle, hindsight_of(bundle, shares=shares_between(bundle, 2, 18, 0.3)))

    assert (calm.state, ids(calm)) == ("healthy", ["SR-LOC-003"])
    assert "cannot be told" in calm.summary
    assert calm.confidence < 0.6
    assert changed.state == "map_changed"


def test_without_map_or_without_hindsight_nothing_is_judged():
    bundle = synthetic_bundle(with_map=False)
    belief = recorded_belief(bundle.view(), at_scans(bundle))
    judgement = judge(bundle.view(), belief, None)

    assert (judgement.state, ids(judgement)) == ("insufficient_data", ["SR-MAP-002"])
    assert judgement.confidence is None
    assert judge(synthetic_bundle().view(), belief, None).state == "insufficient_data"


def test_a_map_of_another_place_is_said():
    bundle = synthetic_bundle()
    nowhere = hindsight_of(bundle, xyyaw=np.full((len(at_scans(bundle)), 3), np.nan), match=np.nan)
    poor = hindsight_of(bundle, match=0.2)
    mediocre_everywhere = hindsight_of(bundle, match=0.6, margin=0.05)

    for hindsight in (nowhere, poor, mediocre_everywhere):
        judgement = judged(bundle, hindsight)
        assert (judgement.state, judgement.failure_mode.kind) == ("insufficient_data", "wrong_map")
        assert "SR-MAP-WRONG" in ids(judgement)


def test_a_map_out_of_scale_is_said_with_its_scale():
    bundle = synthetic_bundle()
    hindsight = replace(hindsight_of(bundle, match=0.65, margin=0.3), scale=1.08)
    judgement = judged(bundle, hindsight)

    assert (judgement.state, judgement.failure_mode.kind) == ("insufficient_data", "wrong_map")
    assert "1.08 times as large" in judgement.summary
    assert any("1.08" in f.message for f in judgement.findings if f.id == "SR-MAP-WRONG")


def test_places_that_odometry_contradicts_all_along_are_no_fit():
    bundle = synthetic_bundle(seconds=30)
    t = (at_scans(bundle) - START_NS) / 1e9
    zigzag = true_path(t) + np.where((t % 6 < 3)[:, None], [1.0, 0, 0], [-1.0, 0, 0])
    hindsight = hindsight_of(bundle, xyyaw=zigzag, match=0.9, margin=0.05)

    assert "SR-MAP-WRONG" in ids(judged(bundle, hindsight))


def test_two_places_that_explain_all_are_unobservable():
    bundle = synthetic_bundle(belief_offset_xyyaw=(3.0, 0.0, 0.0))
    judgement = judged(bundle, hindsight_of(bundle, margin=0.001))

    assert (judgement.state, ids(judgement)) == ("unobservable", ["SR-LOC-002"])


def test_stretch_that_another_place_explains_as_well_is_unobservable():
    bundle = synthetic_bundle(seconds=30.0)
    found = hindsight_of(bundle)
    lead = np.full(len(found.track), 0.4)
    lead[100:200] = 0.02
    xyyaw = found.track.xyyaw.copy()
    xyyaw[100:200] = np.nan
    found = replace(hindsight_of(bundle, xyyaw=xyyaw), lead=lead)

    judgement = judged(bundle, found)

    assert [i.state for i in judgement.intervals] == ["healthy", "unobservable", "healthy"]
    assert (judgement.state, ids(judgement)) == ("healthy", ["SR-LOC-002"])
    assert judgement.intervals[1].confidence is None


def test_poor_hindsight_accuses_nobody():
    bundle = synthetic_bundle(belief_offset_xyyaw=(2.0, 0.0, 0.0), offset_from_s=6.0)
    vague = judged(bundle, hindsight_of(bundle, sigma=0.6))
    match = np.where(np.arange(len(at_scans(bundle))) < 140, 0.9, 0.1)
    unlike = judged(bundle, replace(hindsight_of(bundle), match=match))

    assert (vague.state, ids(vague)) == ("insufficient_data", ["SR-LOC-004"])
    assert spans(unlike)[-1] == ("insufficient_data", 14.0, 20.0)


def test_a_changed_aisle_does_not_excuse_itself_by_its_low_match():
    bundle = synthetic_bundle()
    shares = shares_between(bundle, 5, 12, 0.75)
    match = np.where(shares > 0, 0.23, 0.95)
    judgement = judged(bundle, replace(hindsight_of(bundle, shares=shares), match=match))

    assert judgement.state == "map_changed"


def test_the_covariance_alone_decides_nothing():
    bundle = synthetic_bundle()
    view = bundle.view()
    belief = recorded_belief(view, at_scans(bundle))
    for scale in (1e-6, 1e6):
        told = PoseTrack("map", "base_link", belief.t_ns, belief.xyyaw, belief.cov * scale)
        assert judge(view, told, hindsight_of(bundle)).state == "healthy"


# --- map frame -------------------------------------------------------------------------------


def shifted(bundle, offset):
    """Hindsight as it comes out of the same map laid elsewhere, and the view with that map."""
    grid = room_grid()
    moved = OccupancyGrid(
        grid.cells, grid.resolution_m, se2.compose(offset, grid.origin_xyyaw), grid.frame_id
    )
    hindsight = hindsight_of(bundle)
    track = hindsight.track
    there = PoseTrack("map", "base_link", track.t_ns, se2.compose(offset, track.xyyaw), track.cov)
    return bundle.view().with_grid(moved), replace(hindsight, track=there)


def test_a_shifted_map_is_not_a_lost_robot():
    bundle = synthetic_bundle(seconds=60)
    view, hindsight = shifted(bundle, np.array([1.2, -0.7, 0.2]))
    judgement = judge(view, recorded_belief(view, at_scans(bundle)), hindsight)

    assert (judgement.state, judgement.failure_mode.kind) == ("healthy", "wrong_map")
    assert "SR-MAP-FRAME" in ids(judgement)
    assert "map frame is off, the robot was not lost" in judgement.summary
    assert judgement.findings[0].value > 0.5


def test_where_a_wrong_start_explains_it_equally_that_is_said():
    bundle = synthetic_bundle(seconds=20)
    view, hindsight = shifted(bundle, np.array([1.2, -0.7, 0.0]))
    t = at_scans(bundle)
    # A belief that is odometry from a wrong start: it was never corrected.
    odom = odometry_track(view).at(t).xyyaw
    start = true_path(np.zeros(1))[0]
    belief = PoseTrack.without_covariance(
        "map", "base_link", t, se2.compose(start, se2.between(odom[0], odom))
    )
    judgement = judge(view, belief, hindsight)
    (frame,) = [f for f in judgement.findings if f.id == "SR-MAP-FRAME"]

    assert (judgement.state, frame.severity) == ("lost", "warning")
    assert "wrong start" in frame.message
    assert "would look the same" in judgement.summary


# --- how it began ----------------------------------------------------------------------------


def dead_reckoned(bundle):
    """The belief of a robot that trusts its wheels from the true start on."""
    t = at_scans(bundle)
    odom = odometry_track(bundle.view()).at(t).xyyaw
    start = true_path(np.zeros(1))[0]
    xyyaw = se2.compose(start, se2.between(odom[0], odom))
    return PoseTrack.without_covariance("map", "base_link", t, xyyaw)


def test_wheel_slip_is_told_from_being_carried():
    bundle = synthetic_bundle(seconds=30)
    t = (at_scans(bundle) - START_NS) / 1e9
    belief = dead_reckoned(bundle)
    # Slip: for 4 s the robot makes a third of the way that its wheels count.
    slow = np.interp(t, [0, 10, 14, 40], [0, 10, 11.3, 37.3])
    slip = judge(bundle.view(), belief, hindsight_of(bundle, xyyaw=true_path(slow)))
    # Carried: within one scan it is two metres further on.
    ahead = np.where(t >= 10, t + 4, t)
    carried = judge(bundle.view(), belief, hindsight_of(bundle, xyyaw=true_path(ahead)))

    assert slip.failure_mode.kind == "odometry_slip"
    onset = float(slip.failure_mode.evidence[0].split()[1])
    assert 10.0 <= onset <= 11.5
    assert carried.failure_mode.kind == "kidnapped"
    assert "10.0 s" in carried.failure_mode.evidence[0]


# --- the action gate -------------------------------------------------------------------------


def test_the_books_numbers():
    assert pytest.approx(0.24) == 3 * 0.08
    assert allows(0.08, 0.30)
    assert ratio(0.08, 0.30) == pytest.approx(0.8)
    assert not allows(0.11, 0.30)  # 3 sigma is 33 cm
    assert not allows(0.01, 0.0)
    assert ratio(0.01, -0.1) is None


def test_sigma_is_taken_towards_the_obstacle():
    P = np.diag([0.04, 0.0025, 0.1])

    assert sigma_towards(P, [3.0, 0.0]) == pytest.approx(0.2)
    assert sigma_towards(P, [0.0, -2.0]) == pytest.approx(0.05)
    assert sigma_towards(P, [1.0, 1.0]) == pytest.approx(np.sqrt((0.04 + 0.0025) / 2))
    assert sigma_towards(np.full((3, 3), np.nan), [1.0, 0.0]) is None


def rows(table, t_s, **columns):
    t = START_NS + np.array([ns(s) for s in t_s], dtype=np.int64)
    times = {"t_ns": t, "t_sensor_ns": t, "t_log_ns": t}
    columns = {"topic": [f"/{table}"] * len(t), **columns}
    return Table(TABLES[table], {**times, **columns})


def recovering(t_s, name="Spin", status="running"):
    return rows(
        "recoveries",
        t_s,
        name=[name] * len(t_s),
        status=[status] * len(t_s),
        goal=[""] * len(t_s),
        source=["behavior_tree"] * len(t_s),
    )


def test_clearance_is_from_the_edge_to_the_nearest_wall_of_the_map():
    bundle = synthetic_bundle()
    pose = room_grid().origin_xyyaw  # the room's corner; two metres out from the left wall
    here = se2.compose(pose, np.array([2.0, 4.0, 0.0]))
    t = np.array([START_NS])
    belief = PoseTrack("map", "base_link", t, here[None], np.zeros((1, 3, 3)))
    found = Obstacles(bundle.view(), belief, 0.25).clearance(START_NS)

    assert found.metres == pytest.approx(2.0 - 0.1 - 0.25, abs=0.05)
    direction = np.arctan2(*found.direction_xy[::-1])
    assert abs(se2.wrap_angle(direction - (np.pi + pose[2]))) < 0.05


def test_costmap_tells_radius_and_obstacles_in_its_own_frame():
    cells = np.zeros((60, 60), dtype=np.int8)
    yy, xx = np.mgrid[:60, :60]
    far = np.hypot(xx - 50, yy - 30) * 0.05
    cells[far <= 0.3] = 99
    cells[30, 50] = 100
    table = rows(
        "costmaps",
        [0.0],
        frame_id=["odom"],
        resolution_m=[0.05],
        width=[60],
        height=[60],
        origin_xyyaw=[[-1.5, -1.5, 0.0]],
        cells=[cells.ravel()],
    )
    assert inscribed_radius_m(table) == pytest.approx(0.3, abs=0.05)

    bundle = synthetic_bundle()
    roles = [*bundle.manifest.roles, bundle.manifest.roles[0].model_copy(
        update={"role": "costmap", "topic": "/costmaps"}
    )]  # fmt: skip
    tables = {name: bundle.table(name) for name in TABLES}
    bundle = Bundle(bundle.manifest.model_copy(update={"roles": roles}), tables, {})
    view = BundleView(bundle, replaced_grid=room_grid()).with_table(table)
    belief = recorded_belief(view, at_scans(bundle))
    found = Obstacles(view, belief, 9.0).clearance(int(at_scans(bundle)[1]))

    assert found.metres == pytest.approx(1.0 - 0.3, abs=0.15)
    turn = belief.xyyaw[1, 2]  # odometry began at zero: its axes lie as the robot did
    assert abs(se2.wrap_angle(np.arctan2(*found.direction_xy[::-1]) - turn)) < 0.2


def test_actions_are_put_through_the_gate():
    bundle = synthetic_bundle()
    view = bundle.view().with_table(recovering([4.0, 12.0]))
    belief = recorded_belief(view, at_scans(bundle))
    sure = actions(view, belief, Limits())
    vague = PoseTrack("map", "base_link", belief.t_ns, belief.xyyaw, belief.cov * 1000)
    unsure = actions(view, vague, Limits())
    silent = actions(
        view, PoseTrack.without_covariance("map", "b", belief.t_ns, belief.xyyaw), Limits()
    )

    assert [(a.kind, a.name, a.allowed) for a in sure] == [("recovery", "Spin", True)] * 2
    assert [a.allowed for a in unsure] == [False] * 2
    assert all(a.ratio == pytest.approx(3 * a.sigma_m / a.clearance_m) for a in unsure)
    assert [(a.sigma_m, a.allowed) for a in silent] == [(None, None)] * 2
    assert silent[0].clearance_m is not None


# --- stops -----------------------------------------------------------------------------------


def standing(bundle, from_s, until_s):
    """The bundle's view with an odometry that rests for a while and then goes on."""
    table = bundle.table("transforms")
    t = (table.t_ns - START_NS) / 1e9
    odom = np.flatnonzero(table["child_frame"] == "base_link")
    held_s = np.where(t < from_s, t, np.maximum(from_s, t - (until_s - from_s)))
    path = true_path(held_s[odom])
    position = table["translation_xyz"].copy()
    rotation = table["rotation_xyzw"].copy()
    position[odom, :2] = path[:, :2]
    rotation[odom] = se3.quaternion_from_yaw(path[:, 2])
    return bundle.view().with_table(table.replace(translation_xyz=position, rotation_xyzw=rotation))


def test_a_stop_with_a_recovery_is_listed_with_its_state():
    bundle = synthetic_bundle(seconds=30, belief_offset_xyyaw=(1.0, 0.5, 0), offset_from_s=5.0)
    view = standing(bundle, 10.0, 16.0).with_table(recovering([12.0]))
    judgement = judge(view, recorded_belief(bundle.view(), at_scans(bundle)), hindsight_of(bundle))
    (stop,) = judgement.stops

    assert stop.t_ns == pytest.approx(START_NS + ns(10.0), abs=ns(0.6))
    assert stop.state == "lost"
    assert "lost since 5.0 s" in stop.cause
    assert "'Spin'" in stop.cause
    assert (stop.x_m, stop.y_m) == pytest.approx(tuple(true_path(np.array([10.0]))[0, :2]), abs=0.3)
    assert "it was lost" in judgement.summary


def test_a_stop_at_the_goal_is_planned():
    view = standing(synthetic_bundle(seconds=30), 10.0, 16.0)
    done = recovering([1.0], "NavigateRecovery")
    ended = recovering([10.5], "NavigateRecovery", "success")
    active = view.with_table(done)
    arrived = view.with_table(Table.concat(TABLES["recoveries"], [done, ended]))

    assert stops(view, None, None, ()) == ()
    assert [s.cause for s in stops(active, None, None, ())] == ["its goal was still active"]
    assert stops(arrived, None, None, ()) == ()


def test_judging_twice_gives_the_same():
    bundle = synthetic_bundle(belief_offset_xyyaw=(1.0, 0.5, 0.0), offset_from_s=8.0)

    assert judged(bundle) == judged(bundle)
