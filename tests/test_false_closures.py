"""A repetitive corridor, closures that are false in it, and the round through a common one."""

from pathlib import Path

import numpy as np
import pytest

from slamreplay.estimators import ESTIMATORS
from slamreplay.geometry import se2, se3
from slamreplay.ingest.pipeline import ingest
from slamreplay.labs.false_closures.corridors import round_trip
from slamreplay.labs.false_closures.trials import closed, odometry_end_m
from slamreplay.simulate.bundled import bundle_of
from slamreplay.simulate.corridors import PITCH_M, repetitive_ring
from slamreplay.simulate.recording import record
from slamreplay.simulate.worlds import rasterise

SAMPLE = Path(__file__).resolve().parents[1] / "sample_logs" / "corridor_100m.mcap"


def test_nothing_in_the_repetitive_corridor_is_unique():
    grid = rasterise(repetitive_ring(), 0.05, as_map=True)
    pitch = round(PITCH_M / 0.05)
    low, high = grid.cell_of(np.array([[4.0, -0.2], [33.9, 2.1]]))
    side = grid.cells[low[0] : high[0], low[1] : high[1]]

    assert (side[:, pitch:] == side[:, :-pitch]).all()
    assert (grid.cells == grid.cells[::-1, ::-1]).all()  # turned by half a turn


@pytest.fixture(scope="module")
def repetitive():
    recording = record(round_trip("repetitive", 0.0, 1))
    return bundle_of(recording).view(), recording


def test_by_the_score_alone_false_closures_bend_the_way_and_the_kernel_undoes_them(repetitive):
    bare, held = closed(*repetitive, 0.65, is_checked=False)

    assert bare.false > 0
    assert bare.best_false > 0.7  # they look as good as many a true one
    assert np.hypot(*(bare.false_to - bare.false_from).T).min() > 0.5
    assert held.left_on == 0
    assert held.largest_m < 0.3 * bare.largest_m


def test_checked_closures_are_true_whatever_they_score(repetitive):
    bare, _ = closed(*repetitive, 0.4, is_checked=True)

    assert bare.taken > 0
    assert bare.false == 0
    assert bare.largest_m < 0.15
    assert odometry_end_m(repetitive[1]) > 1.0


def test_the_pose_graph_closes_the_corridor_of_100_m(tmp_path):
    bundle = ingest([SAMPLE], tmp_path / "bundle")
    reference = bundle.table("references")
    yaw = se3.yaw_from_quaternion(reference["orientation_xyzw"])
    true = np.column_stack([reference["position_xyz"][:, :2], yaw])

    def error(name):
        track = ESTIMATORS.load(name)().run(bundle.view(), seed=0).track
        track = track.take(track.has_pose)
        there = se2.interpolate(reference.t_ns, true, track.t_ns)
        way = np.hypot(*np.diff(there[:, :2], axis=0).T).sum()
        # Each from where it began: the pose somebody clicked is not what is asked for.
        here = se2.compose(there[0], se2.between(track.xyyaw[0], track.xyyaw))
        return np.hypot(*(here - there)[:, :2].T), way

    odometry, way = error("dead_reckoning")
    graph, _ = error("pose_graph")

    assert way == pytest.approx(100.0, abs=1.0)
    assert 1.0 < odometry[-1] < 3.0
    assert graph[-1] < 0.05
    assert np.sqrt(np.mean(graph**2)) < 0.05
