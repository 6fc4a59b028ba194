"""The robot is found without its belief, and a changed room is told from a right one."""

import numpy as np
import pytest

from slamreplay.bundle.products import Hindsight
from slamreplay.geometry import se2
from slamreplay.hindsight.pipeline import hindsight
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.testing.synthetic import room_grid, synthetic_bundle, true_path


def errors(found: Hindsight) -> np.ndarray:
    t_s = (found.track.t_ns - found.track.t_ns[0]) / 1e9
    off = se2.between(true_path(t_s), found.track.xyyaw)
    return np.column_stack([np.hypot(off[:, 0], off[:, 1]), np.abs(off[:, 2])])


def changed_room() -> OccupancyGrid:
    cells = room_grid().cells.copy()
    cells[80:100, 100:140] = 0  # the island is gone
    cells[40:50, 60:80] = 100  # a box stands
    return OccupancyGrid(cells, 0.05, room_grid().origin_xyyaw)


@pytest.fixture(scope="module")
def healthy() -> Hindsight:
    found = hindsight(synthetic_bundle(seconds=40.0, with_initial_pose=False).view())
    assert found is not None
    return found


def test_robot_is_found_without_belief_or_initial_pose(healthy):
    error = errors(healthy)

    assert len(healthy.track) == 400
    assert healthy.coverage == 1.0
    assert np.quantile(error[:, 0], 0.95) < 0.08
    assert np.quantile(error[:, 1], 0.95) < np.radians(1.5)
    assert healthy.margin is not None
    assert healthy.margin > 0.05


def test_right_pose_in_the_room_as_mapped_has_no_changes(healthy):
    assert healthy.changes is not None
    assert np.nanmax(healthy.changes.changed_share) < 0.02
    assert healthy.changes.regions == ()


def test_missing_island_and_new_box_are_found_and_do_not_move_the_robot():
    bundle = synthetic_bundle(seconds=40.0, world=changed_room())
    found = hindsight(bundle.view())

    assert found is not None
    assert found.changes is not None
    assert np.quantile(errors(found)[:, 0], 0.95) < 0.1
    assert np.nanmedian(found.changes.changed_share) > 0.08
    kinds = {r.kind: r for r in found.changes.regions}
    island = se2.transform_points(room_grid().origin_xyyaw, np.array([[6.0, 4.5]]))[0]
    box = se2.transform_points(room_grid().origin_xyyaw, np.array([[3.5, 2.25]]))[0]
    for kind, (x, y) in (("removed", island), ("appeared", box)):
        x_min, y_min, x_max, y_max = kinds[kind].bbox_m
        assert x_min < x < x_max
        assert y_min < y < y_max


def test_belief_is_not_read(healthy):
    lost = synthetic_bundle(seconds=40.0, belief_offset_xyyaw=(3.0, 1.0, 1.0))
    found = hindsight(lost.view())

    assert found is not None
    assert np.quantile(errors(found)[:, 0], 0.95) < 0.08


def test_without_a_map_there_is_no_hindsight():
    assert hindsight(synthetic_bundle(seconds=2.0, with_map=False).view()) is None
