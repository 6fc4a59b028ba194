"""SLAM by a pose graph: laps in a room whose every pose is known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from slamreplay.bundle.run import Trial
from slamreplay.bundle.track import PoseTrack
from slamreplay.errors import NotApplicableError, UsageError
from slamreplay.estimators.pose_graph.candidates import Candidate, relations_of
from slamreplay.estimators.pose_graph.carrying import carried, carried_covariances
from slamreplay.estimators.pose_graph.closing import Closer
from slamreplay.estimators.pose_graph.config import GraphConfig
from slamreplay.estimators.pose_graph.doubt import doubted
from slamreplay.estimators.pose_graph.estimator import PoseGraph, PoseGraphOnline
from slamreplay.estimators.pose_graph.product import map_and_graph
from slamreplay.estimators.pose_graph.refining import overlapping
from slamreplay.estimators.pose_graph.submaps import chain_covariances, submaps
from slamreplay.estimators.scan_matching.follower import Fit
from slamreplay.estimators.scan_matching.local import LocalTrajectory
from slamreplay.geometry import se2
from slamreplay.geometry.covariance import composed
from slamreplay.graph.online import OnlineGraph
from slamreplay.ingest.pipeline import ingest
from slamreplay.postmortem import postmortem
from slamreplay.replay.runner import replay
from slamreplay.report.figures.canvas import plain_style, svg_bytes
from slamreplay.report.figures.graph import graph_figure
from slamreplay.report.html import html
from slamreplay.testing.edits import without
from slamreplay.testing.synthetic import START_NS, synthetic_bundle, true_path

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def laps():
    """A lap and a half, 30 m, without a map or a belief: nothing to go by but scans and wheels."""
    return synthetic_bundle(
        seconds=60.0, with_map=False, with_belief=False, with_initial_pose=False
    )


@pytest.fixture(scope="module")
def batch(laps):
    return PoseGraph().run(laps.view(), seed=0)


@pytest.fixture(scope="module")
def online(laps):
    return PoseGraphOnline().run(laps.view(), seed=0)


def truth_of(track):
    """The true path in the track's frame, which begins at the first pose."""
    path = true_path((track.t_ns - START_NS) / 1e9)
    return se2.between(path[0], path)


def errors(track):
    off = track.xyyaw - truth_of(track)
    off[:, 2] = se2.wrap_angle(off[:, 2])
    return off


def closures(estimate):
    (found,) = (i for i in estimate.innovations if i.source == "loop closure")
    return found


def test_the_path_is_known_to_centimetres_without_any_map(batch):
    off = errors(batch.track)

    assert batch.track.frame_id == "odom"
    assert batch.track.xyyaw[0] == pytest.approx(np.zeros(3), abs=1e-6)
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.05
    assert np.abs(off[:, 2]).max() < np.radians(0.7)


def test_covariances_hold_the_error_and_grow_away_from_the_start(batch):
    off, cov = errors(batch.track), batch.track.cov
    some = np.arange(50, len(off), 10)

    nees = np.einsum("ni,nij,nj->n", off[some], np.linalg.inv(cov[some]), off[some])

    assert nees.mean() < 5.0
    assert cov[200, 0, 0] > cov[30, 0, 0]


def test_closures_are_told_with_all_that_led_to_them(batch, laps):
    found = closures(batch)

    assert found.accepted.sum() >= 3
    assert batch.scalars["closures_accepted"] == found.accepted.sum()
    assert batch.scalars["relations_between_passes"] > 50
    assert found.residual.shape == (len(found.t_ns), 3)
    assert np.linalg.eigvalsh(found.S).min() > 0.0
    assert (found.score[found.accepted] >= GraphConfig().min_score).all()
    first, last = found.about[0].split(" -> ")
    assert int(first.removeprefix("node ")) < int(last.removeprefix("node "))
    assert np.isfinite(found.moved[found.accepted]).all()
    assert not found.moved[~found.accepted].any()
    assert set(found.t_ns) <= set(laps.table("scans").t_ns)


def test_a_jump_of_the_online_path_is_that_of_the_closure(online):
    """What the ledger says a closure moved is how far the path leaps at its time."""
    found, track = closures(online), online.track
    k = int(np.argmax(np.hypot(found.moved[:, 0], found.moved[:, 1]) * found.accepted))
    row = int(np.searchsorted(track.t_ns, found.t_ns[k]))
    way = truth_of(track)
    driven = se2.between(way[row - 1], way[row])
    expected = se2.compose(track.xyyaw[row - 1], driven)

    leap = track.xyyaw[row] - expected

    assert found.accepted[k]
    # The submap's reference lies some metres back: a turn there swings what is here.
    assert np.hypot(*(leap[:2] - found.moved[k, :2])) < 0.02 + 3.0 * abs(found.moved[k, 2])
    assert leap[2] == pytest.approx(found.moved[k, 2], abs=0.005)


def test_only_what_scores_enough_is_taken_in(laps):
    estimate = PoseGraph().run(laps.view().with_setting("min_score", 2.0), seed=0)
    found = closures(estimate)

    assert len(found.t_ns) > 3
    assert not found.accepted.any()
    assert estimate.scalars["relations_between_passes"] == 0.0


def test_told_noise_scales_the_covariances(laps, batch):
    view = laps.view().with_setting("process_noise_scale", 4.0)
    more = PoseGraph().run(view.with_setting("measurement_noise_scale", 4.0), seed=0)

    ratio = more.track.cov[300:, 0, 0] / batch.track.cov[300:, 0, 0]

    assert np.median(ratio) == pytest.approx(4.0, rel=0.3)


def test_it_runs_without_odometry(laps):
    estimate = PoseGraph().run(without(laps, "odometry").view(), seed=0)
    off = errors(estimate.track)

    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.1


def test_the_start_is_taken_from_the_map_and_the_map_from_the_scans():
    """The room has changed since it was mapped: the path does not follow the old map."""
    bundle = synthetic_bundle(seconds=20.0)
    track = PoseGraph().run(bundle.view(), seed=0).track
    path = true_path((track.t_ns - START_NS) / 1e9)

    off = track.xyyaw - path

    assert track.frame_id == "map"
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.05
    assert np.sqrt(track.cov[0, 0, 0]) < 0.05  # the given start was known to 0.2 m


def test_a_log_without_scans_is_no_case_for_it(laps):
    with pytest.raises(NotApplicableError, match="scans"):
        PoseGraph().run(without(laps, "scans").view(), seed=0)


def test_parameters_are_set_by_name():
    estimator = PoseGraph.from_parameters({"min_score": 0.7, "passes": 2})

    assert estimator.config == replace(GraphConfig(), min_score=0.7, passes=2)
    with pytest.raises(UsageError, match="min_scor") as caught:
        PoseGraphOnline.from_parameters({"min_scor": 0.7})
    assert "min_score" in str(caught.value.hint)
    with pytest.raises(UsageError, match="min_score"):
        PoseGraph.from_parameters({"min_score": "high"})


def test_the_covariance_of_a_chain_is_that_of_its_steps_one_by_one():
    rng = np.random.default_rng(5)
    poses = np.cumsum(rng.normal(0.0, 1.0, (9, 3)), axis=0)
    root = rng.normal(0.0, 0.1, (8, 3, 3))
    motion_cov = root @ np.swapaxes(root, 1, 2)

    found = chain_covariances(poses, motion_cov, np.array([1, 4, 8]))

    for (first, last), cov in zip([(1, 4), (4, 8)], found, strict=True):
        P = np.zeros((3, 3))
        for k in range(first, last):
            steps = se2.between(poses[first], poses[k]), se2.between(poses[k], poses[k + 1])
            P = composed(steps[0], P, steps[1], motion_cov[k])
        assert cov == pytest.approx(P, abs=1e-12)


@pytest.mark.parametrize(("nis", "ratio"), [(0.1, 1.0), (2.366, 1.0), (11.83, 5.0), (900.0, 10.0)])
def test_motions_are_trusted_by_what_good_matches_say(nis, ratio):
    local = handmade_local(x=np.arange(4.0), nodes=[0, 1, 2, 3], breaks=[], missed=[])
    local = replace(local, points=tuple(np.eye(2) for _ in range(4)))
    closer = Closer(submaps(local, 1.0, 10.0), OnlineGraph(np.zeros(3), np.eye(3)), GraphConfig())

    closer.told += [nis] * 4
    few = closer.ratio
    closer.told.append(nis)

    assert few == 1.0
    assert closer.ratio == pytest.approx(ratio)


def test_nodes_of_the_same_pass_are_not_laid_onto_each_other():
    x = np.concatenate([np.arange(0.0, 20.0, 0.5), np.arange(20.0, 0.0, -0.5)])
    poses = np.column_stack([x, 0.1 * np.sin(x), np.repeat([0.0, 0.3], 40)])
    way = np.append(0.0, np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T)))
    config = GraphConfig()

    pairs = overlapping(poses, way, config)

    assert len(pairs)
    assert (pairs[:, 0] < 40).all()
    assert (pairs[:, 1] >= 40).all()
    assert (np.abs(x[pairs[:, 0]] - x[pairs[:, 1]]) <= config.pass_m).all()
    assert 2 <= np.bincount(pairs[:, 1]).max() <= config.passes


def test_scans_that_fit_nothing_before_a_break_belong_to_what_follows():
    """Nodes 0, 1 | 2: the robot was carried away after scan 2; scans 3 and 4 fitted nothing."""
    local = handmade_local(
        x=[0.0, 1.0, 1.2, 1.4, 1.6, 1.8], nodes=[0, 1, 5], breaks=[2], missed=[3, 4]
    )
    poses = np.array([[0.0, 0, 0], [1, 0, 0], [50, 9, 0]])
    cov = np.array([1e-6, 1e-6, 4.0])[:, None, None] * np.eye(3)

    xyyaw = carried(local, poses)
    covs = carried_covariances(local, poses, cov)

    assert xyyaw[:3, 0] == pytest.approx([0.0, 1.0, 1.2])
    assert xyyaw[3:, 0] == pytest.approx([49.6, 49.8, 50.0])
    assert xyyaw[3:, 1] == pytest.approx(9.0)
    assert covs[2, 1, 1] < 0.01
    assert covs[4, 1, 1] == pytest.approx(4.0, rel=0.2)


def handmade_local(x, nodes, breaks, missed):
    count, rows = len(x), np.array(nodes)
    pose = np.column_stack([x, np.zeros(count), np.zeros(count)])
    is_break = np.zeros(len(nodes), dtype=bool)
    is_break[breaks] = True
    fit = Fit(np.zeros(3), np.zeros(3), np.eye(3), 0.9, accepted=True, moved=np.zeros(3))
    fits = [replace(fit, accepted=k not in missed) for k in range(count)]
    tiny = np.tile(np.eye(3) * 1e-6, (count, 1, 1))
    none = tuple(np.empty((0, 2)) for _ in nodes)
    return LocalTrajectory(
        np.arange(count) * 10**8, pose, np.full(count, 0.9), rows, none, np.zeros(2),
        np.full(len(nodes), 0.9), tiny[: len(nodes) - 1], is_break, none, tiny, tuple(fits),
    )  # fmt: skip


def test_motions_are_doubted_where_the_wheels_say_something_else():
    local = handmade_local(x=[0.0, 0.2, 0.9, 1.1], nodes=[0, 1, 2, 3], breaks=[], missed=[])
    wheels = np.column_stack([[0.0, 0.2, 0.4, 0.6], np.zeros(4), np.zeros(4)])
    odometry = PoseTrack.without_covariance("odom", "base_link", local.t_ns, wheels)

    cov = doubted(local, odometry)

    assert cov[[0, 2]] == pytest.approx(local.motion_cov[[0, 2]])
    assert np.sqrt(cov[1, 0, 0]) == pytest.approx(0.5, rel=0.05)
    assert np.sqrt(cov[1, 1, 1]) < 0.2
    assert doubted(local, None) is local.motion_cov


def test_no_candidates_make_no_relations():
    assert len(relations_of([])) == 0
    one = Candidate(0, 7, np.ones(3), np.eye(3), 0.9, np.zeros(3), np.eye(3), 0.0)
    assert relations_of([one]).pairs.tolist() == [[0, 7]]


def test_the_picture_shows_nodes_and_closures(laps):
    made = map_and_graph(laps.view())

    with plain_style():
        figure = graph_figure(made, 8.0)
        text = svg_bytes(figure).decode()

    assert f"{len(made.node_xyyaw)} nodes" in text
    assert f"{made.accepted.sum()} loop closures" in text
    assert made.closures.shape == (len(made.accepted), 2)
    assert np.hypot(*(made.points - made.points.mean(axis=0)).T).max() < 12.0


def test_a_round_of_100_m_ends_where_it_began(tmp_path):
    """Odometry alone is more than a metre off there."""
    bundle = ingest([ROOT / "sample_logs" / "corridor_100m.mcap"], tmp_path / "b")
    references = bundle.table("references")
    truth = references["position_xyz"][:, :2][[0, -1]]

    track = PoseGraph().run(bundle.view(), seed=0).track

    ends = track.xyyaw[[0, -1], :2]
    assert np.hypot(*(ends[1] - truth[1])) < 0.05
    assert np.hypot(*((ends[1] - ends[0]) - (truth[1] - truth[0]))) < 0.05


def test_the_report_of_its_run_shows_map_and_closures(laps):
    runs = replay(laps, [Trial(laps.manifest.bundle_id, "pose_graph", 0)])
    page = html(postmortem(laps, runs))
    assert "The map that the pose graph made" in page
    assert "places that were looked for again, of which" in page
