"""Local SLAM: scans laid onto lines, and what happens where odometry or the scans fail."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slamreplay.bundle.scans import ScanSet, scan_set
from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.evidence.references import candidates
from slamreplay.errors import NotApplicableError, UsageError
from slamreplay.estimators.scan_matching.drift import drifted
from slamreplay.estimators.scan_matching.estimator import ScanMatching
from slamreplay.estimators.scan_matching.local import MatchConfig, local_trajectory
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import composed, turned
from slamreplay.ingest.pipeline import ingest
from slamreplay.maps.raycast import cast_rays
from slamreplay.matching.line_map import LineMap, align
from slamreplay.matching.scan_lines import scan_lines
from slamreplay.replay.relations import relation_errors
from slamreplay.testing import edits
from slamreplay.testing.synthetic import room_grid, synthetic_bundle, true_path

BEARINGS = np.radians(np.arange(-135.0, 135.5, 1.0))
STEP_NS = 100_000_000


def scans_of(ranges, odometry=None, *, t_ns=None, max_m=10.0, sweep_s=0.0):
    """Scans (N, B) of a laser at the base; no return beyond `max_m`."""
    n = len(ranges)
    t_ns = np.arange(n) * STEP_NS if t_ns is None else t_ns
    hits = np.isfinite(ranges) & (ranges < max_m)
    track = None
    if odometry is not None:
        track = PoseTrack.without_covariance("odom", "base", t_ns, np.array(odometry))
    step = BEARINGS[1] - BEARINGS[0]
    return ScanSet(
        t_ns, ranges.astype(np.float32), np.full(n, BEARINGS[0]), np.full(n, step),
        np.full(n, sweep_s / (len(BEARINGS) - 1)), hits, ~hits, np.full(n, max_m), np.zeros(3),
        track,
    )  # fmt: skip


def room_scans(poses, noise_m=0.005, seed=0):
    rng = np.random.Generator(np.random.PCG64(seed))
    ranges = cast_rays(room_grid(), np.array(poses), BEARINGS, 15.0)
    return ranges + rng.normal(0.0, noise_m, ranges.shape)


def corridor_scans(poses, noise_m=0.01, seed=0):
    """Two bare walls 2.2 m apart, endless."""
    rng = np.random.Generator(np.random.PCG64(seed))
    poses = np.array(poses)
    sine = np.sin(poses[:, 2:] + BEARINGS)
    with np.errstate(divide="ignore"):
        left, right = (1.0 - poses[:, 1:2]) / sine, (-1.2 - poses[:, 1:2]) / sine
    reach = np.minimum(np.where(sine > 0.0, left, np.inf), np.where(sine < 0.0, right, np.inf))
    return reach + rng.normal(0.0, noise_m, reach.shape)


def run_local(scans, config=None):
    return local_trajectory(scans, scans.odometry, config)


def way(seconds):
    return true_path(np.arange(0.0, seconds, 0.1))


def lines_of(ranges, during=(0.0, 0.0, 0.0)):
    points, normals = np.empty((len(ranges), 2)), np.empty((len(ranges), 2))
    count = scan_lines(
        np.asarray(ranges, dtype=np.float32), np.isfinite(ranges), BEARINGS[0],
        BEARINGS[1] - BEARINGS[0], np.zeros(3), np.array(during), points, normals,
    )  # fmt: skip
    return points[:count].copy(), normals[:count].copy()


def test_normals_stand_on_walls_and_face_the_laser():
    points, normals = lines_of(corridor_scans([(0.0, 0.0, 0.0)], noise_m=0.0)[0])
    near = np.abs(points[:, 0]) < 2.0
    found = np.hypot(*normals.T) > 0.0
    assert found[near].all()
    assert not found[np.abs(points[:, 0]) > 8.0].any()  # beams too far apart to be one wall
    expected = np.column_stack([np.zeros(near.sum()), -np.sign(points[near, 1])])
    np.testing.assert_allclose(normals[near], expected, atol=1e-4)


def test_a_jump_in_range_is_no_wall():
    ranges = np.full(len(BEARINGS), np.nan)
    ranges[100:120], ranges[120:140] = 2.0, 5.0
    points, normals = lines_of(ranges)
    facing = (normals * -points).sum(axis=1) / np.hypot(*points.T)
    found = np.hypot(*normals.T) > 0.0
    assert found.sum() > 20
    assert (facing[found] > 0.9).all()


def test_motion_in_a_sweep_is_taken_out():
    during = np.array([0.3, 0.1, 0.4])
    start = np.array([3.0, 4.0, 0.3])
    parts = np.linspace(0.0, 1.0, len(BEARINGS))
    at = se2.compose(start, parts[:, None] * during)
    ranges = np.array(
        [cast_rays(room_grid(), p, b[None], 15.0)[0, 0] for p, b in zip(at, BEARINGS, strict=True)]
    )
    still, _ = lines_of(cast_rays(room_grid(), start, BEARINGS, 15.0)[0])
    moved, _ = lines_of(ranges, during)
    smeared, _ = lines_of(ranges)

    def apart(points):
        off = np.hypot(*(points[:, None] - still[None]).transpose(2, 0, 1))
        return np.quantile(off.min(axis=1), 0.9)

    assert apart(moved) < 0.1 < 0.2 < apart(smeared)


def test_both_faces_of_a_thin_wall_are_kept():
    lines = LineMap.empty(10)
    x = np.arange(0.0, 1.0, 0.02)
    for y, facing in ((0.02, -1.0), (0.06, 1.0)):
        points = np.column_stack([x, np.full(len(x), y)])
        lines.add(np.zeros(3), points, np.tile([0.0, facing], (len(x), 1)))
    held = lines.points(np.array([0.5, 0.0]), 1.0)
    assert sorted(set(np.round(held[:, 1], 9))) == [0.02, 0.06]


def test_lines_are_forgotten_and_the_torus_does_not_alias():
    lines = LineMap.empty(2)
    point, facing = np.array([[0.05, 0.05]]), np.array([[0.0, 1.0]])
    lines.add(np.zeros(3), point, facing)
    assert len(lines.points(np.zeros(2), 1.0)) == 1
    assert len(lines.points(np.array([102.4, 0.0]), 1.0)) == 0
    for _ in range(2):
        lines.add(np.array([5.0, 0.0, 0.0]), point, facing)
        assert len(lines.points(np.zeros(2), 1.0)) == 1
    lines.add(np.array([5.0, 0.0, 0.0]), point, facing)
    assert len(lines.points(np.zeros(2), 1.0)) == 0
    lines.clear()
    assert len(lines.points(np.array([5.0, 0.0]), 1.0)) == 0


@settings(max_examples=25, deadline=None)
@given(st.floats(-0.12, 0.12), st.floats(-0.12, 0.12), st.floats(-0.08, 0.08))
def test_a_scan_finds_its_pose_in_the_map(dx, dy, turn):
    lines, first = LineMap.empty(10), np.array([4.0, 5.0, 0.4])
    for off in ((0.0, 0.0, 0.0), (0.2, 0.1, 0.1), (-0.2, 0.2, -0.1)):
        pose = first + np.array(off)
        lines.add(pose, *lines_of(cast_rays(room_grid(), pose, BEARINGS, 15.0)[0]))
    truth = first + np.array([0.05, -0.08, 0.05])
    pose, out = truth + np.array([dx, dy, turn]), np.empty((4, 3))
    points, normals = lines_of(cast_rays(room_grid(), truth, BEARINGS, 15.0)[0])
    score, squares, _ = align(
        lines.tags, lines.lines, lines.now - 10, points, normals, pose, pose.copy(),
        np.eye(3) * 1e-6, 0.02, 1e-4, 20, out,
    )  # fmt: skip
    np.testing.assert_allclose(pose, truth, atol=0.006)
    assert score > 0.9
    assert squares < 0.02**2
    assert np.linalg.eigvalsh(out[:3])[0] > 10.0  # a room holds all three


def test_a_room_is_followed_to_millimetres_whatever_odometry_says():
    truth = way(12.0)
    backwards = se2.compose(truth[0], se2.inverse(se2.between(truth[0], truth)))
    backwards[:, 2] = truth[:, 2]  # reverse driving told as forward
    for odometry in (truth, np.tile(truth[0], (len(truth), 1)), backwards, None):
        local = run_local(scans_of(room_scans(truth), odometry))
        off = se2.between(se2.between(truth[0], truth), se2.between(local.xyyaw[0], local.xyyaw))
        assert not local.is_break.any()
        assert np.hypot(off[:, 0], off[:, 1]).max() < 0.03
        assert np.abs(off[:, 2]).max() < 0.01


def test_odometry_that_begins_anew_is_no_motion():
    truth = way(6.0)
    odometry = truth.copy()
    odometry[30:] = se2.between(truth[30], truth[30:])
    for sweep_s in (0.0, 0.08):
        local = run_local(scans_of(room_scans(truth), odometry, sweep_s=sweep_s))
        off = se2.between(se2.between(truth[0], truth), local.xyyaw)
        assert not local.is_break.any()
        assert np.hypot(off[:, 0], off[:, 1]).max() < 0.03 + sweep_s


def test_stamps_that_stand_still_do_not_matter():
    truth = way(4.0)
    t_ns = np.zeros(len(truth), dtype=np.int64)
    local = local_trajectory(scans_of(room_scans(truth), t_ns=t_ns, sweep_s=0.08), None)
    assert np.isfinite(local.xyyaw).all()
    off = se2.between(se2.between(truth[0], truth), local.xyyaw)
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.03


def test_a_gap_in_odometry_is_matched_through():
    truth = way(12.0)
    scans = scans_of(room_scans(truth), truth)
    keep = np.ones(len(truth), dtype=bool)
    keep[40:80] = False
    local = local_trajectory(scans, scans.odometry.take(keep))
    assert np.isfinite(local.xyyaw).all()
    assert not local.is_break.any()
    off = se2.between(se2.between(truth[0], truth), local.xyyaw)
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.03


def test_a_bare_corridor_keeps_to_odometry_and_the_covariance_says_so():
    truth = np.column_stack([np.arange(0.0, 15.0, 0.1), np.zeros((150, 2))])
    local = run_local(scans_of(corridor_scans(truth), truth, max_m=8.0))
    off = se2.between(truth[0], truth) - local.xyyaw
    assert np.abs(off[:, 0]).max() < 0.1
    assert np.abs(off[:, 1]).max() < 0.05
    sigma = np.sqrt(np.diagonal(drifted(local, 0, np.zeros((3, 3)))[-1]))
    assert sigma[0] > 0.03
    along = np.sqrt(local.motion_cov[10:, 0, 0])
    across = np.sqrt(local.motion_cov[10:, 1, 1])
    assert (along > 4.0 * across).all()


def test_reverse_driving_that_odometry_tells_as_forward():
    """Down a corridor, away from its end, which is out of reach after 6 m."""
    truth = np.column_stack([np.arange(0.0, -8.0, -0.1), np.zeros((80, 2))])
    ahead = np.cos(BEARINGS) > 0.02
    end = np.where(ahead, (2.0 - truth[:, :1]) / np.where(ahead, np.cos(BEARINGS), 1.0), np.inf)
    sides = corridor_scans(truth)
    ranges = np.minimum(np.where(sides < 5.0, sides, np.inf), np.where(sides < end, np.inf, end))
    local = run_local(scans_of(ranges, np.abs(truth), max_m=8.0))
    np.testing.assert_allclose(local.xyyaw[:55, 0], truth[:55, 0], atol=0.03)
    assert local.xyyaw[-1, 0] < -5.0  # and not forward by 2 m, as odometry has it


def test_a_robot_that_is_carried_away_begins_a_new_map():
    truth = way(6.0)
    elsewhere = corridor_scans(np.zeros((20, 3)))
    odometry = np.concatenate([truth, np.tile(truth[-1], (20, 1))])
    scans = scans_of(np.concatenate([room_scans(truth), elsewhere]), odometry)
    local = run_local(scans)
    assert local.is_break.sum() == 1
    first = local.nodes[local.is_break][0]
    assert first == len(truth) + MatchConfig().lost_scans - 1
    assert not any(fit.accepted for fit in local.fits[len(truth) : first + 1])
    assert all(fit.accepted for fit in local.fits[first + 1 :])
    np.testing.assert_allclose(local.motion_cov[np.flatnonzero(local.is_break)[0] - 1], np.eye(3))


def test_scans_without_returns_are_carried_by_odometry():
    truth = way(6.0)
    ranges = room_scans(truth)
    ranges[30:40] = np.inf
    local = run_local(scans_of(ranges, truth))
    assert not local.is_break.any()
    assert not set(range(30, 40)) & set(local.nodes.tolist())
    off = se2.between(se2.between(truth[0], truth), local.xyyaw)
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.03
    assert (np.diff(local.cov[29:40, 0, 0]) > 0.0).all()


def test_scans_are_carried_with_their_nodes():
    local = run_local(scans_of(room_scans(way(5.0)), way(5.0)))
    np.testing.assert_allclose(local.carried(local.node_xyyaw), local.xyyaw, atol=1e-9)
    moved = se2.compose(np.array([3.0, -2.0, 1.0]), local.node_xyyaw)
    expected = se2.compose(np.array([3.0, -2.0, 1.0]), local.xyyaw)
    np.testing.assert_allclose(
        se2.between(expected, local.carried(moved)), np.zeros_like(expected), atol=1e-9
    )


def test_covariances_add_up_over_the_nodes():
    local = run_local(scans_of(room_scans(way(6.0)), way(6.0)))
    start = np.diag([0.04, 0.01, 0.0025])
    found = drifted(local, 0, start)
    pose, cov = local.node_xyyaw[0], start + local.cov[0]
    for k in range(len(local.nodes) - 1):
        step = se2.between(local.node_xyyaw[k], local.node_xyyaw[k + 1])
        cov = composed(pose, cov, step, local.motion_cov[k])
        pose = se2.compose(pose, step)
    cov = cov + local.cov[local.nodes[-1]]
    np.testing.assert_allclose(found[local.nodes[-1]], cov, rtol=1e-6)
    np.testing.assert_allclose(found[0], start)
    assert (np.linalg.eigvalsh(found[1:]) > 0.0).all()


@pytest.mark.parametrize("name", ["corridor_100m", "healthy"])
def test_errors_are_as_large_as_the_covariances_say(name, request, tmp_path):
    """Mean NEES of all later poses, had any of some poses been known: near 3."""
    bundle = ingest([request.config.rootpath / "sample_logs" / f"{name}.mcap"], tmp_path / "b")
    scans = scan_set(bundle.view())
    local = run_local(scans)
    (reference,) = (c.track for c in candidates(bundle) if c.kind == "simulation")
    truth = reference.at(scans.t_ns).xyyaw
    nees = []
    for row in range(0, len(scans) - 100, 100):
        known = np.flatnonzero(np.isfinite(truth[:, 0]) & (np.arange(len(scans)) > row))
        off = se2.compose(truth[row], se2.between(local.xyyaw[row], local.xyyaw)) - truth
        off[:, 2] = se2.wrap_angle(off[:, 2])
        cov = turned(drifted(local, row, np.zeros((3, 3))), truth[row, 2] - local.xyyaw[row, 2])
        white = np.linalg.solve(cov[known], off[known, :, None])[..., 0]
        nees.append((off[known] * white).sum(axis=1).mean())
    assert 0.75 < np.mean(nees) < 7.8
    step = se2.between(se2.between(truth[:-1], truth[1:]),
                       se2.between(local.xyyaw[:-1], local.xyyaw[1:]))  # fmt: skip
    assert np.nanmedian(np.hypot(step[:, 0], step[:, 1])) < 0.004
    assert np.nanmedian(np.abs(step[:, 2])) < 0.001


def test_the_ledger_tells_match_prediction_and_what_came_of_them():
    bundle = synthetic_bundle(seconds=6.0)
    estimate = ScanMatching().run(bundle.view(), seed=0)
    (ledger,) = estimate.innovations
    track = estimate.track
    assert ledger.source == "scan match"
    assert ledger.frame_id == track.frame_id == "map"
    assert len(ledger.t_ns) == len(track) - 1
    assert ledger.accepted.all()
    assert (ledger.score > 0.5).all()
    assert np.median(ledger.nis) < 7.8
    # Between prediction and match, nearer to the surer one.
    assert (np.abs(ledger.moved) <= np.abs(ledger.residual) + 0.01).mean() > 0.9
    assert estimate.diagnostics["matched"].sum() == len(track) - 1
    assert estimate.scalars["nodes"] == estimate.diagnostics["node"].sum() > 5


def test_it_starts_where_the_log_says_and_else_at_odometry():
    bundle = synthetic_bundle(seconds=4.0)
    track = ScanMatching().run(bundle.view(), seed=0).track
    start = bundle.table("initial_poses")
    np.testing.assert_allclose(track.xyyaw[0, :2], start["position_xyz"][0, :2], atol=1e-9)
    bare = synthetic_bundle(seconds=4.0, with_initial_pose=False, with_belief=False)
    track = ScanMatching().run(bare.view(), seed=0).track
    assert track.frame_id == "odom"
    assert not track.cov[0].any()


def test_it_needs_scans_only():
    bundle = synthetic_bundle(seconds=4.0)
    for part in ("odometry", "map"):
        assert ScanMatching().run(edits.without(bundle, part).view(), seed=0).track.has_pose.all()
    with pytest.raises(NotApplicableError, match="laser scans"):
        ScanMatching().run(edits.without(bundle, "scans").view(), seed=0)


def test_noise_is_scaled_as_told():
    view = synthetic_bundle(seconds=4.0).view()
    plain = ScanMatching().run(view, seed=0).innovations[0].S
    told = ScanMatching().run(view.with_setting("measurement_noise_scale", 9.0), seed=0)
    assert np.median(told.innovations[0].S[:, 0, 0] / plain[:, 0, 0]) > 1.5
    told = ScanMatching().run(view.with_setting("process_noise_scale", 9.0), seed=0)
    assert (told.innovations[0].S[0, 0, 0] / plain[0, 0, 0]) > 1.2


def test_parameters_by_name():
    assert ScanMatching.from_parameters({"node_m": 0.3}).config == MatchConfig(node_m=0.3)
    with pytest.raises(UsageError, match="memory"):
        ScanMatching.from_parameters({"memory": 0})
    with pytest.raises(UsageError, match="nodem") as error:
        ScanMatching.from_parameters({"nodem": 0.3})
    assert "node_m" in str(error.value.hint)


def test_a_second_run_gives_the_same_bytes():
    scans = scans_of(room_scans(way(3.0)), way(3.0))
    one, two = run_local(scans), run_local(replace(scans))
    assert one.xyyaw.tobytes() == two.xyyaw.tobytes()
    assert one.cov.tobytes() == two.cov.tobytes()


@pytest.mark.parametrize(
    ("name", "near_m", "near_deg", "all_m", "all_deg"),
    [("intel", 0.014, 0.22, 0.35, 1.5), ("aces", 0.037, 0.36, 0.25, 0.8)],
)
def test_relations_of_real_logs(real_logs, tmp_path, name, near_m, near_deg, all_m, all_deg):
    """Errors of the measured relations (Kuemmerle 2009), without closing any loop."""
    log = real_logs / "radish" / f"{name}.clf.bz2"
    if not log.is_file():
        pytest.skip(f"no {log}")
    bundle = ingest([log], tmp_path / "b")
    scans = scan_set(bundle.view())
    local = run_local(scans)
    pairs = np.loadtxt(log.with_name(f"{name}.relations"))
    stamps = bundle.table("scans").sorted_by_time()["t_sensor_ns"] / 1e9
    order = np.argsort(stamps)
    rows = order[np.searchsorted(stamps[order], pairs[:, :2] - 5e-4)]
    off = relation_errors(local.xyyaw, rows, pairs[:, [2, 3, 7]])
    distance, turn = np.hypot(off[:, 0], off[:, 1]), np.degrees(np.abs(off[:, 2]))
    near = np.abs(rows[:, 1] - rows[:, 0]) < 50
    assert near.mean() > 0.5
    assert distance[near].mean() < near_m
    assert turn[near].mean() < near_deg
    assert distance.mean() < all_m
    assert turn.mean() < all_deg
    assert not local.is_break.any()


def test_open3d_may_take_the_steps():
    truth = way(4.0)
    try:
        local = run_local(scans_of(room_scans(truth), truth), MatchConfig(icp="open3d"))
    except NotApplicableError as error:
        pytest.skip(str(error))
    off = se2.between(se2.between(truth[0], truth), local.xyyaw)
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.03
    with pytest.raises(UsageError, match="icp"):
        ScanMatching.from_parameters({"icp": "gicp"})
