"""The robot is found without its belief, and a changed room is told from a right one."""

from collections.abc import Callable

import numpy as np
import pytest

from slamreplay.bundle.manifest import Role
from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Ragged, Table
from slamreplay.bundle.view import Bundle, BundleView
from slamreplay.geometry import se2, se3
from slamreplay.geometry.times import NS_PER_S
from slamreplay.hindsight import scale
from slamreplay.hindsight.pipeline import hindsight
from slamreplay.ingest.options import IngestOptions
from slamreplay.ingest.pipeline import ingest
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.raycast import cast_rays
from slamreplay.testing.synthetic import MOUNT_XYYAW, room_grid, synthetic_bundle, true_path


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


def test_covariance_means_what_it_says(healthy):
    t_s = (healthy.track.t_ns - healthy.track.t_ns[0]) / 1e9
    off = healthy.track.xyyaw - true_path(t_s)
    off[:, 2] = se2.wrap_angle(off[:, 2])
    nees = np.einsum("ni,nij,nj->n", off, np.linalg.inv(healthy.track.cov), off)

    assert 1.0 < nees.mean() < 6.0


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


def with_scans(view: BundleView, change: Callable[[np.ndarray], np.ndarray]) -> BundleView:
    scans = view.table("scans")
    ranges = [change(scans["ranges_m"][i]) for i in range(len(scans))]
    return view.with_table(scans.replace(ranges_m=Ragged.of(ranges, np.float32)))


@pytest.mark.parametrize(
    "change",
    [lambda r: r[:0], lambda r: np.full_like(r, np.inf), lambda r: np.full_like(r, np.nan)],
    ids=["empty", "no returns", "invalid"],
)
def test_scans_that_say_nothing_give_no_pose(change):
    found = hindsight(with_scans(synthetic_bundle(seconds=3.0).view(), change))

    assert found is not None
    assert found.coverage == 0.0
    assert len(found.track) == 30


def test_robot_is_found_without_odometry():
    view = synthetic_bundle(seconds=20.0).view()
    tf = view.table("transforms")
    view = view.with_table(view.table("odometry").take(np.arange(0)))
    found = hindsight(view.with_table(tf.take(tf["child_frame"] != "base_link")))

    assert found is not None
    assert np.quantile(errors(found)[:, 0], 0.95) < 0.1


def test_robot_is_found_without_odometry_on_both_sides_of_lost_scans():
    view = synthetic_bundle(seconds=30.0).view()
    tf, scans = view.table("transforms"), view.table("scans")
    t_s = (scans.t_ns - scans.t_ns[0]) / NS_PER_S
    view = view.with_table(view.table("odometry").take(np.arange(0)))
    view = view.with_table(scans.take((t_s < 10.0) | (t_s > 15.0)))
    found = hindsight(view.with_table(tf.take(tf["child_frame"] != "base_link")))

    assert found is not None
    assert found.coverage > 0.95
    assert np.nanquantile(errors(found)[:, 0], 0.99) < 0.1


def swept(view: BundleView, sweep_s: float) -> BundleView:
    """The same scans, taken while the robot drove on from beam to beam."""
    scans = view.table("scans")
    t_s = (scans.t_ns - scans.t_ns[0]) / NS_PER_S
    beam = np.arange(len(scans["ranges_m"][0]))
    bearing = scans["angle_min_rad"][0] + beam * scans["angle_increment_rad"][0]
    grid = room_grid()
    step_s = sweep_s / (len(beam) - 1)
    ranges = []
    for t in t_s:
        rays = se2.compose(true_path(t + beam * step_s), MOUNT_XYYAW)
        rays[:, 2] += bearing
        ranges.append(cast_rays(grid, rays, np.zeros(1), 10.0)[:, 0])
    return view.with_table(
        scans.replace(
            ranges_m=Ragged.of(ranges, np.float32),
            time_increment_s=np.full(len(scans), step_s),
        )
    )


def test_motion_within_a_sweep_is_taken_out_without_odometry_too():
    view = swept(synthetic_bundle(seconds=20.0).view(), 0.09)
    tf = view.table("transforms")
    view = view.with_table(view.table("odometry").take(np.arange(0)))
    found = hindsight(view.with_table(tf.take(tf["child_frame"] != "base_link")))

    assert found is not None
    assert np.median(errors(found)[:, 0]) < 0.026
    assert np.quantile(errors(found)[:, 1], 0.95) < np.radians(0.6)


def test_kidnapped_robot_is_found_on_both_sides():
    view = synthetic_bundle(seconds=40.0).view()
    scans, tf = view.table("scans"), view.table("transforms")
    start = scans.t_ns[0]
    gone = (scans.t_ns >= start + 15 * NS_PER_S) & (scans.t_ns < start + 25 * NS_PER_S)
    # Odometry goes on after the gap as if nothing had happened in it.
    moving = np.flatnonzero(tf["child_frame"] == "base_link")
    t_s = (tf.t_ns[moving] - start) / NS_PER_S
    before = moving[np.searchsorted(t_s, 15.0)]
    after = moving[np.searchsorted(t_s, 25.0)]
    xyyaw = np.column_stack(
        [tf["translation_xyz"][:, :2], se3.yaw_from_quaternion(tf["rotation_xyzw"])]
    )
    late = moving[t_s >= 25.0]
    carried = se2.compose(xyyaw[before], se2.between(xyyaw[after], xyyaw[late]))
    translation, rotation = tf["translation_xyz"].copy(), tf["rotation_xyzw"].copy()
    translation[late, :2] = carried[:, :2]
    rotation[late] = se3.quaternion_from_yaw(carried[:, 2])
    moved = tf.replace(translation_xyz=translation, rotation_xyzw=rotation)
    stays = np.ones(len(tf), dtype=bool)
    stays[moving[(t_s > 15.0) & (t_s < 25.0)]] = False

    found = hindsight(view.with_table(scans.take(~gone)).with_table(moved.take(stays)))

    assert found is not None
    assert found.coverage > 0.95
    assert np.nanquantile(errors(found)[:, 0], 0.95) < 0.15


def test_two_like_places_leave_no_margin():
    cells = room_grid().cells.copy()
    symmetric = np.maximum(cells, cells[::-1, ::-1])
    room = OccupancyGrid(symmetric, 0.05, room_grid().origin_xyyaw)
    found = hindsight(synthetic_bundle(seconds=20.0, world=room).view().with_grid(room))

    assert found is not None
    assert found.margin is not None
    assert found.margin < 0.02


def test_foreign_map_gives_no_pose():
    cells = np.zeros((300, 400), dtype=np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    for k in range(12):
        cells[40 + 18 * k : 44 + 18 * k, 30 + 25 * k : 60 + 25 * k] = 100
    foreign = OccupancyGrid(cells, 0.05, np.zeros(3))
    found = hindsight(synthetic_bundle(seconds=40.0).view().with_grid(foreign))

    assert found is not None
    assert found.coverage == 0.0


def test_same_log_gives_the_same_bytes(healthy):
    again = hindsight(synthetic_bundle(seconds=40.0, with_initial_pose=False).view())

    assert again is not None
    assert again.track.xyyaw.tobytes() == healthy.track.xyyaw.tobytes()
    assert again.track.cov.tobytes() == healthy.track.cov.tobytes()


def test_jarvis_is_found_to_some_centimetres(real_logs, tmp_path):
    folder = real_logs / "inesctec_jarvis"
    options = IngestOptions(map=folder / "maps" / "i-108_10mm.yaml")
    log = folder / "jarvis_circular_path_fast.bag"
    bundle = ingest([log], tmp_path / "jarvis.bundle", options)
    found = hindsight(bundle.view())

    assert found is not None
    assert found.coverage == 1.0
    table = bundle.table("references")
    reference = se2.interpolate(
        table.t_ns,
        np.column_stack(
            [table["position_xyz"][:, :2], se3.yaw_from_quaternion(table["orientation_xyzw"])]
        ),
        found.track.t_ns,
    )
    # The reference's frame lies a rigid transform away: the best one is taken off (Umeyama).
    a = reference[:, :2] - reference[:, :2].mean(axis=0)
    b = found.track.xyyaw[:, :2] - found.track.xyyaw[:, :2].mean(axis=0)
    cross = a.T @ b
    turn = np.arctan2(cross[0, 1] - cross[1, 0], cross[0, 0] + cross[1, 1])
    off = se2.transform_points(np.array([0.0, 0.0, turn]), a) - b
    assert np.median(np.hypot(*off.T)) < 0.05


def test_a_second_laser_that_sees_another_world_does_not_hide_the_first():
    """A scanner near the floor among feet and pallets that move with the robot's every step."""
    bundle = synthetic_bundle(seconds=15.0)
    scans = bundle.table("scans")
    rng = np.random.Generator(np.random.PCG64(4))
    ranges = scans["ranges_m"]
    clutter = Ragged(rng.uniform(0.3, 6.0, len(ranges.values)).astype(np.float32), ranges.offsets)
    low = scans.replace(ranges_m=clutter, topic=np.full(len(scans), "/low", dtype=object))
    both = Table.concat(TABLES["scans"], [scans, low]).sorted_by_time()
    role = Role(role="scan_2", topic="/low", type="", messages=len(low), reason="")
    manifest = bundle.manifest.model_copy(update={"roles": [*bundle.manifest.roles, role]})
    tables = {**{name: bundle.table(name) for name in TABLES}, "scans": both}
    found = hindsight(
        Bundle(manifest, tables, {bundle.manifest.maps[-1].version: bundle.grid()}).view()
    )

    assert found is not None
    assert found.coverage > 0.99
    assert np.percentile(errors(found)[:, 0], 95) < 0.08


@pytest.mark.parametrize("times", [0.85, 1.12])
def test_scale_of_the_map_is_told(times):
    bundle, room = synthetic_bundle(seconds=20.0), room_grid()
    drawn = OccupancyGrid(room.cells, times * room.resolution_m, times * room.origin_xyyaw)
    found = hindsight(bundle.view().with_grid(drawn))

    assert found.scale == pytest.approx(times, rel=0.03)


def test_map_to_scale_is_left_at_that(healthy, monkeypatch):
    monkeypatch.setattr(scale, "ASK_BELOW", 1.1)
    found = hindsight(synthetic_bundle(seconds=20.0, world=changed_room()).view())

    assert healthy.scale is None
    assert found.scale is None
