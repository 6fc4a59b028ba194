"""What there was to see at each moment: scans, beam classes, particles, plans, marks and lanes."""

import numpy as np
import pytest

from slamreplay.evidence.scene import Met
from slamreplay.evidence.scene_of import scene_of
from slamreplay.evidence.scene_scans import chosen
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.postmortem import postmortem
from slamreplay.testing.synthetic import room_grid, synthetic_bundle


def room_with_a_box() -> OccupancyGrid:
    """The synthetic room with something set down that the map lacks."""
    grid = room_grid()
    cells = grid.cells.copy()
    cells[60:70, 40:56] = 100
    return OccupancyGrid(cells, grid.resolution_m, grid.origin_xyyaw)


@pytest.fixture(scope="module")
def boxed():
    bundle = synthetic_bundle(
        seconds=12.0,
        world=room_with_a_box(),
        belief_offset_xyyaw=(1.5, 0.5, 0.1),
        offset_from_s=5.0,
    )
    return bundle.view(), postmortem(bundle, cause=False)


def test_changed_share_is_the_share_of_beams_classed_so(boxed):
    _, post = boxed
    (scans,), changes = post.scene.scans, post.hindsight.changes

    valid = np.count_nonzero(scans.met != Met.INVALID, axis=1)
    changed = np.isin(scans.met, (Met.APPEARED, Met.REMOVED)).sum(axis=1)
    assert np.array_equal(scans.t_ns, changes.t_ns)
    assert changed.max() > 5
    assert np.array_equal(changed / valid, changes.changed_share)


def test_marks_stand_in_time_order_and_tell_when_the_robot_was_lost(boxed):
    _, post = boxed
    marks = post.scene.marks

    (lost,) = [m for m in marks if m.kind == "lost"]
    assert [m.t_ns for m in marks] == sorted(m.t_ns for m in marks)
    assert post.seconds(lost.t_ns) == pytest.approx(5.0, abs=0.5)
    assert {"lost", "jump", "start", "finding"} <= {m.kind for m in marks}


def test_lanes_are_as_long_as_their_times_and_carry_the_verdicts_limits(boxed):
    _, post = boxed
    lanes = {lane.key: lane for lane in post.scene.lanes}

    assert set(lanes) == {"error_m", "error_deg", "sigma_m", "nees", "changed_share", "match"}
    assert all(len(lane.t_ns) == len(lane.values) for lane in lanes.values())
    assert np.array_equal(lanes["error_m"].values, post.error.distance_m, equal_nan=True)
    assert lanes["error_m"].limit == post.limits.position_m
    assert "3 dof" in lanes["nees"].title


def test_fewer_scans_are_shown_but_the_first_the_last_and_those_around_what_happened(boxed):
    view, post = boxed
    (few,) = scene_of(post, view, most_scans=24).scans
    (every,) = scene_of(post, view, most_scans=None).scans
    (lost,) = [m for m in post.scene.marks if m.kind == "lost"]

    assert len(every.t_ns) == 120
    assert len(few.t_ns) <= 24
    assert (few.t_ns[0], few.t_ns[-1]) == (every.t_ns[0], every.t_ns[-1])
    rows = np.searchsorted(every.t_ns, few.t_ns)
    for name in ("ends_m", "is_hit", "met"):
        assert np.array_equal(getattr(few, name), getattr(every, name)[rows])
    assert np.abs(few.t_ns - lost.t_ns).min() <= 200_000_000


def test_chosen_rows_are_never_more_than_were_asked_for():
    t_ns = np.arange(1000, dtype=np.int64) * 100_000_000
    for most in (2, 3, 10, 100):
        rows = chosen(t_ns, [0, 5_000_000_000, 99_900_000_000], most)
        assert len(rows) <= most
        assert (rows[0], rows[-1]) == (0, 999)
        assert (np.diff(rows) > 0).all()
