"""Faults put into a log: what was asked for is what is in it, and nothing else."""

import numpy as np
import pytest

from slamreplay.bench import inject, inject_map
from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.track import PoseTrack
from slamreplay.errors import UsageError
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.testing.synthetic import START_NS, synthetic_bundle, true_path

CUT = (START_NS + 8 * NS_PER_S, START_NS + 14 * NS_PER_S)


@pytest.fixture(scope="module")
def view():
    return synthetic_bundle(seconds=20.0).view()


def truth(t_ns):
    return true_path((np.asarray(t_ns) - START_NS) / 1e9)


def off(a, b):
    return np.hypot(*(a - b)[:, :2].T)


def test_kidnap_closes_times_and_joins_odometry(view):
    injection = inject.kidnap(view, *CUT)
    scans = injection.view.role("scan")

    assert len(scans) == 140
    assert np.diff(scans.t_ns).max() <= 0.11 * NS_PER_S
    assert injection.view.manifest.end_ns == view.manifest.end_ns - 6 * NS_PER_S
    before = view.role("scan")
    row = int(np.flatnonzero(before.t_ns == injection.recorded_ns(scans.t_ns)[100])[0])
    np.testing.assert_array_equal(scans["ranges_m"][100], before["ranges_m"][row])
    for track in (odometry_track(injection.view), _of_topic(injection.view)):
        steps = np.hypot(*np.diff(track.xyyaw[:, :2], axis=0).T)
        assert steps.max() < 0.06  # 0.5 m/s at 20 Hz, and noise
        assert np.abs(se2.wrap_angle(np.diff(track.xyyaw[:, 2]))).max() < 0.1


def _of_topic(view):
    rows = view.role("odometry")
    from slamreplay.geometry import se3

    yaw = se3.yaw_from_quaternion(rows["orientation_xyzw"])
    xyyaw = np.column_stack([rows["position_xyz"][:, :2], yaw])
    return PoseTrack.without_covariance("odom", "base_link", rows.t_ns, xyyaw)


def test_after_a_kidnap_the_belief_goes_on_from_where_the_robot_was_taken(view):
    injection = inject.kidnap(view, *CUT)
    t_ns = injection.view.role("scan").t_ns
    belief = recorded_belief(injection.view, t_ns).xyyaw
    error = off(belief, truth(injection.recorded_ns(t_ns)))

    early = t_ns < CUT[0]
    assert error[early].max() < 0.1
    carried = off(truth(CUT[:1]), truth(CUT[1:]))[0]
    assert error[~early][0] == pytest.approx(carried, abs=0.3)
    assert error[~early].min() > 1.0


def test_kidnap_needs_odometry_on_both_sides(view):
    with pytest.raises(UsageError, match="both sides"):
        inject.kidnap(view, CUT[0], view.manifest.end_ns + 60 * NS_PER_S)


def test_wrong_start_moves_the_belief_from_a_time_on(view):
    injection = inject.wrong_start(view, CUT[0], (0.8, -0.3, 0.5))
    t_ns = view.role("scan").t_ns
    before, after = (recorded_belief(v, t_ns).xyyaw for v in (view, injection.view))

    same = t_ns < CUT[0]
    np.testing.assert_allclose(after[same], before[same])
    moved = se2.between(before[~same], after[~same])
    assert np.abs(moved[10] - (0.8, -0.3, 0.5)).max() < 0.6  # it turned about where it was
    np.testing.assert_allclose(moved[:, 2], 0.5, atol=1e-9)
    np.testing.assert_allclose(odometry_track(view).xyyaw, odometry_track(injection.view).xyyaw)


def test_map_edits_change_their_box_and_nothing_else(view):
    grid = view.grid
    island = _box(grid, (80, 100), (100, 140))
    gone = inject_map.appeared(view, island)
    assert (gone.view.grid.cells[80:100, 100:140] == 0).all()
    np.testing.assert_allclose(gone.box_m, _around(grid, (80, 100), (100, 140)), atol=1e-6)

    spot = grid.centre_of([40, 60])
    drawn = inject_map.removed(view, (*(spot - 0.2), *(spot + 0.2)))
    new = drawn.view.grid.occupied & ~grid.occupied
    assert 30 < new.sum() < 80
    assert ((grid.centre_of(np.argwhere(new)) - spot) ** 2).max() < 0.2**2 + 1e-9

    other = inject_map.moved(view, island, (0.0, 1.0))
    assert (other.view.grid.cells != grid.cells).sum() <= 2 * 800
    assert other.view.grid.occupied.sum() == pytest.approx(grid.occupied.sum(), abs=60)
    np.testing.assert_allclose(other.box_m, gone.box_m)
    assert other.from_box_m[1] - other.box_m[1] == pytest.approx(1.0, abs=0.1)
    assert view.grid.version == grid.version
    with pytest.raises(UsageError, match="no mapped wall"):
        inject_map.appeared(view, (*(spot - 0.2), *(spot + 0.2)))


def _box(grid, rows, cols):
    return tuple(float(v) for v in _around(grid, rows, cols))


def _around(grid, rows, cols):
    centres = grid.centre_of(np.array([[r, c] for r in range(*rows) for c in range(*cols)]))
    half = grid.resolution_m / 2
    return (*(centres.min(axis=0) - half), *(centres.max(axis=0) + half))


def test_a_track_becomes_the_belief():
    view = synthetic_bundle(seconds=10.0, with_belief=False).view()
    t_ns = view.role("scan").t_ns
    assert recorded_belief(view, t_ns) is None
    track = PoseTrack.without_covariance("map", "base_link", t_ns, truth(t_ns))

    told = inject.with_localizer(view, track)

    belief = recorded_belief(told, t_ns)
    assert off(belief.xyyaw, track.xyyaw).max() < 0.1
    assert (np.diff(np.flatnonzero(belief.has_pose)) == 1).all()


def test_a_wall_at_the_edge_of_the_unknown_leaves_known_room_behind():
    bundle = synthetic_bundle(seconds=3.0)
    grid = bundle.view().grid
    cells = grid.cells.copy()
    cells[:2] = -1  # the room's lower wall is two cells thick; now only one is known
    cells[1] = 100
    dark = type(grid)(cells, grid.resolution_m, grid.origin_xyyaw)
    view = bundle.view().with_grid(dark)
    box = _box(grid, (0, 3), (60, 80))

    edited = inject_map.appeared(view, box).view.grid

    assert (edited.cells[:2, 62:78] == 0).all()
    assert (edited.cells[0, 100:] == -1).all()
