"""Scans made of clouds, against rays cast in the plane from where the sensor was."""

from dataclasses import replace

import numpy as np
import pytest
from layered_lidar import DepthCamera, LayeredLidar, mount

from slamreplay.bundle.track import PoseTrack
from slamreplay.geometry import se2
from slamreplay.ingest.clouds.body import without_body
from slamreplay.ingest.clouds.fields import Clouds
from slamreplay.ingest.clouds.flatten import flattened
from slamreplay.ingest.clouds.place import Place
from slamreplay.ingest.clouds.setting import settle
from slamreplay.ingest.clouds.sweep import SweepMotion, sweep_motion
from slamreplay.maps.raycast import cast_rays
from slamreplay.simulate.drive import Follow, Spin, drive
from slamreplay.simulate.worlds import World, box, rasterise, room_walls, warehouse

START_NS = 1_750_000_000_000_000_000
SIGMA_M = 0.02


@pytest.fixture(scope="module")
def hall():
    return rasterise(warehouse(), 0.025, as_map=False)


@pytest.fixture(scope="module")
def tour():
    return drive((1.5, 1.3, 0.0), (Follow(((5.0, 1.2),)), Spin(2.0), Spin(-2.0)))


def clouds_of(points, sweep_s, t_s, *, keep=None):
    """Clouds of points (N, R, C, 3); `keep` (N, R, C) makes them heaps of those points only."""
    n, rows = points.shape[:2]
    late = np.broadcast_to(sweep_s, points.shape[:3])
    t_ns = START_NS + np.rint(np.asarray(t_s) * 1e9).astype(np.int64)
    keep = np.ones(points.shape[:3], dtype=bool) if keep is None else keep
    lengths = keep.reshape(n, -1).sum(axis=1)
    return Clouds(
        xyz=points[keep].T.astype(np.float32),
        time=late[keep].astype(np.float64),
        offsets=np.concatenate([[0], np.cumsum(lengths)]),
        rows=np.full(n, rows if keep.all() else 1),
        frame_id=np.full(n, "lidar", dtype=object),
        t_sensor_ns=t_ns,
        t_log_ns=t_ns + 105_000_000,
        index=np.arange(n),
    )


def place_at(T, **other):
    return Place(
        **{
            "frame": "lidar",
            "level_frame": "lidar_level",
            "base": "base_link",
            "T_base_sensor": T,
            "is_on_tf": True,
            "is_own_frame": True,
            "is_fixed": True,
            "ground_z": 0.0,
            **other,
        }
    )


def track_of(motion):
    t_ns = START_NS + np.rint(motion.t_s * 1e9).astype(np.int64)
    return PoseTrack.without_covariance("odom", "base_link", t_ns, motion.xyyaw.copy())


def standing(xyyaw=(9.0, 4.6, 0.4)):
    return lambda t_s: np.broadcast_to(np.array(xyyaw), (len(t_s), 3)).copy()


def scans_of(clouds, T, motion=None, band=None, place=None):
    setting = settle(clouds, place or place_at(T), band)
    mounts = np.broadcast_to(T, (len(clouds), 4, 4))
    during = motion(clouds, setting) if motion else SweepMotion.none(len(clouds))
    return (*flattened(clouds, setting, mounts, during), setting)


def cast(grid, base, lidar, setting):
    """(N, B) ranges of the scan's beams in the plane, from where the sensor was."""
    rays = se2.compose(base, np.append(lidar.T_base_sensor[:2, 3], 0.0))
    bearings = setting.angle_min + np.arange(setting.beams) * setting.increment
    return cast_rays(grid, rays, bearings, lidar.range_max_m)


def off_by(ranges, expected):
    both = np.isfinite(ranges) & np.isfinite(expected)
    return np.abs(ranges[both] - expected[both])


MOUNTS = {
    "level": mount(),
    "tilted": mount(pitch=np.radians(10.0), roll=np.radians(-4.0)),
    "upside down": mount(z=1.5, roll=np.pi - 0.05),
}


@pytest.mark.parametrize("name", MOUNTS)
def test_ranges_are_those_of_a_planar_laser_at_the_sensor(hall, tour, name):
    lidar = LayeredLidar(T_base_sensor=MOUNTS[name], sigma_m=SIGMA_M)
    t_s = np.arange(0.1, tour.t_s[-1] - 0.2, 0.25)
    points = lidar.sweeps(hall, tour.poses_at, t_s, np.random.default_rng(1))
    clouds = clouds_of(points, lidar.sweep_s, t_s)

    def motion(clouds, setting):
        return sweep_motion(clouds, clouds.t_sensor_ns, setting.times, track_of(tour))

    ranges, _, outside, setting = scans_of(clouds, lidar.T_base_sensor, motion)
    expected = cast(hall, tour.poses_at(t_s), lidar, setting)

    off = off_by(ranges, expected)
    # The rest are edges: what a beam half meets is told, and half of them lie on either side.
    assert np.mean(off < 0.03) > 0.95
    assert np.median(off) < 0.01
    assert np.isfinite(ranges).mean() > 0.97
    assert (setting.increment, setting.beams, outside) == (np.radians(0.5), 720, 0)


def test_a_wall_is_told_in_the_middle_of_each_beam():
    """Columns lie 0.4 degrees apart and beams 0.5: no point is where its beam looks."""
    wall = World((-30.0, -30.0, 30.0, 30.0), (box("wall", -8.0, 2.0, 30.0, 0.2),))
    grid = rasterise(wall, 0.01, as_map=False)
    base = np.array([[0.0, 0.0, 0.15]])
    lidar = LayeredLidar()
    points = lidar.sweeps(grid, standing(base[0]), np.zeros(1))

    ranges, _, _, setting = scans_of(clouds_of(points, lidar.sweep_s, [0.0]), lidar.T_base_sensor)

    off = off_by(ranges, cast(grid, base, lidar, setting))
    assert len(off) > 200
    assert np.quantile(off, 0.98) < 0.001


def test_motion_compensation_mends_the_scans_of_a_turning_robot(hall, tour):
    lidar = LayeredLidar(sigma_m=SIGMA_M)
    t_s = np.arange(0.1, tour.t_s[-1] - 0.2, 0.1)
    turning = np.abs(tour.twist[np.rint(t_s * 50).astype(int), 1]) > 0.5
    t_s = t_s[turning]
    points = lidar.sweeps(hall, tour.poses_at, t_s, np.random.default_rng(1))
    clouds = clouds_of(points, lidar.sweep_s, t_s)

    def motion(clouds, setting):
        return sweep_motion(clouds, clouds.t_sensor_ns, setting.times, track_of(tour))

    mended, _, _, setting = scans_of(clouds, lidar.T_base_sensor, motion)
    smeared = scans_of(clouds, lidar.T_base_sensor)[0]
    expected = cast(hall, tour.poses_at(t_s), lidar, setting)

    assert np.quantile(off_by(mended, expected), 0.9) < 0.03
    assert np.quantile(off_by(smeared, expected), 0.9) > 0.2
    assert np.median(off_by(smeared, expected)) > 4.0 * np.median(off_by(mended, expected))


def test_beyond_the_odometry_a_sweep_is_left_as_it_is(hall, tour):
    lidar = LayeredLidar()
    t_s = np.array([0.5, 0.6])
    clouds = clouds_of(lidar.sweeps(hall, tour.poses_at, t_s), lidar.sweep_s, t_s)
    track = track_of(tour)
    ends = track.take(track.t_ns <= clouds.t_sensor_ns[1] + 50_000_000)
    setting = settle(clouds, place_at(lidar.T_base_sensor), None)

    moved = sweep_motion(clouds, clouds.t_sensor_ns, setting.times, ends)

    assert moved.still == 1
    assert np.abs(moved.xyyaw).max(axis=(1, 2)).tolist()[1] == 0.0
    assert np.abs(moved.xyyaw[0]).max() > 0.0


def test_floor_and_ceiling_are_no_walls():
    bare = rasterise(World((-30.0, -30.0, 30.0, 30.0), ()), 0.1, as_map=False)
    lidar = LayeredLidar(sigma_m=0.01)
    points = lidar.sweeps(bare, standing((0.0, 0.0, 0.0)), np.array([0.0, 0.1]),
                          np.random.default_rng(0))  # fmt: skip

    ranges, reach, _, _ = scans_of(
        clouds_of(points, lidar.sweep_s, [0.0, 0.1]), lidar.T_base_sensor
    )

    assert np.isfinite(points[..., 0]).mean() > 0.5  # the floor and the ceiling
    # Where no cloud sees a wall nobody knows how far the sensor sees: not even emptiness is told.
    assert np.isnan(ranges).all()
    assert reach.tolist() == [30.0, 30.0]


@pytest.fixture(scope="module")
def bay():
    """A wide hall with a wall ahead and a crate of 0.5 m somewhere to the left."""
    bounds = (-30.0, -30.0, 30.0, 30.0)
    return World(bounds, (box("wall ahead", 6.0, -6.0, 0.2, 12.0),))


def looks(bay, lidar, *, keep=None):
    grid = rasterise(bay, 0.025, as_map=False)
    t_s = np.array([0.0, 0.1, 0.2])
    points = lidar.sweeps(grid, standing((0.0, 0.0, 0.0)), t_s, np.random.default_rng(0))
    cells = None if keep is None else keep(points)
    clouds = clouds_of(points, lidar.sweep_s, t_s, keep=cells)
    ranges, reach, _, setting = scans_of(clouds, lidar.T_base_sensor)
    bearings = setting.angle_min + np.arange(setting.beams) * setting.increment
    return ranges, reach, np.degrees(se2.wrap_angle(bearings))


LEVEL_RINGS = np.radians([-15.0, -11.0, -7.0, -3.0, -1.0, 0.0, 1.0, 3.0, 7.0])
SHORT = LayeredLidar(elevations=LEVEL_RINGS, range_max_m=12.0, sigma_m=0.01)


def test_rays_that_come_back_from_nowhere_prove_free_space(bay):
    ranges, reach, bearings = looks(bay, SHORT)

    assert np.isfinite(ranges[:, np.abs(bearings) < 40.0]).all()
    # To the sides nothing came back from a level ring of an organised cloud.
    assert np.isposinf(ranges[:, np.abs(bearings) > 60.0]).mean() > 0.99
    # Free is claimed no farther than the farthest wall that this cloud shows.
    np.testing.assert_allclose(
        reach, np.nanmax(np.where(np.isinf(ranges), 0, ranges), axis=1) + 0.01
    )


def test_a_heap_of_points_proves_nothing_where_none_is(bay):
    ranges, _, bearings = looks(bay, SHORT, keep=lambda points: np.isfinite(points[..., 0]))

    assert np.isfinite(ranges[:, np.abs(bearings) < 40.0]).all()
    assert np.isnan(ranges[:, np.abs(bearings) > 60.0]).all()


def test_rays_that_leave_the_band_prove_nothing_beyond_it():
    """A lidar pitched forward: to its sides rays stay level, ahead and behind they leave the band.

    A wall to the left tells how far it sees; to the right nothing comes back from as far; ahead the
    floor and behind the ceiling end rays that were in the band for three metres only.
    """
    wall = World((-30.0, -30.0, 30.0, 30.0), (box("wall", -6.0, 6.0, 12.0, 0.2),))
    lidar = LayeredLidar(
        elevations=np.radians([-1.0, 0.0, 1.0]),
        T_base_sensor=mount(pitch=np.radians(10.0), yaw=0.0),
        sigma_m=0.01,
    )

    ranges, reach, bearings = looks(wall, lidar)

    assert (reach > 6.0).all()
    assert np.isfinite(ranges[:, np.abs(bearings - 90.0) < 10.0]).all()
    assert np.isposinf(ranges[:, np.abs(bearings + 90.0) < 5.0]).all()
    assert np.isnan(ranges[:, np.abs(bearings) < 30.0]).all()
    assert np.isnan(ranges[:, np.abs(bearings) > 150.0]).all()


def test_holes_of_a_depth_camera_are_no_free_space(bay):
    camera = DepthCamera(sigma_m=0.005)
    ranges, _, bearings = looks(bay, camera)

    assert np.isfinite(ranges).mean() > 0.5
    assert not np.isposinf(ranges).any()
    assert np.abs(bearings).max() < 55.0  # no wider than it sees
    ahead = ranges[:, np.abs(bearings) < 3.0]
    np.testing.assert_allclose(ahead[np.isfinite(ahead)], 6.0 - 0.25, atol=0.03)


def test_the_nearest_surface_in_the_band_counts(bay):
    """A crate below the sensor's height is met, one below the band is not."""
    crate = rasterise(World(bay.bounds, (box("crate", 3.0, -0.6, 0.6, 1.2),)), 0.025, as_map=False)
    wall = rasterise(bay, 0.025, as_map=False)
    t_s, rng = np.array([0.0]), np.random.default_rng(0)

    def met(height_m):
        lidar = LayeredLidar(elevations=np.radians(np.arange(-15.0, 5.0, 0.5)), sigma_m=0.005)
        far = lidar.sweeps(wall, standing((0.0, 0.0, 0.0)), t_s, rng)
        near = replace(lidar, wall_m=height_m).sweeps(crate, standing((0.0, 0.0, 0.0)), t_s, rng)
        nearer = np.nan_to_num(np.linalg.norm(near, axis=-1), nan=np.inf)
        nearer = nearer < np.nan_to_num(np.linalg.norm(far, axis=-1), nan=np.inf)
        points = np.where(nearer[..., None], near, far)
        ranges, _, _, setting = scans_of(clouds_of(points, lidar.sweep_s, t_s), lidar.T_base_sensor)
        return ranges[0, setting.beams // 2]

    assert met(0.4) == pytest.approx(3.0 - 0.1, abs=0.03)
    assert met(0.15) == pytest.approx(6.0 - 0.1, abs=0.03)


def test_the_robots_own_returns_are_no_walls(bay):
    lidar = LayeredLidar(sigma_m=0.01)
    grid = rasterise(bay, 0.025, as_map=False)
    t_s = np.array([0.0, 0.1])
    points = lidar.sweeps(grid, standing((0.0, 0.0, 0.0)), t_s, np.random.default_rng(0))
    points[:, :, 400:410] *= 0.2 / np.linalg.norm(points[:, :, 400:410], axis=-1, keepdims=True)

    ranges = scans_of(clouds_of(points, lidar.sweep_s, t_s), lidar.T_base_sensor)[0]

    assert np.nanmin(ranges) > 3.0


def test_a_post_that_turns_with_the_robot_is_its_body(tour):
    t_ns = START_NS + np.rint(np.arange(0.0, tour.t_s[-1], 0.1) * 1e9).astype(np.int64)
    rng = np.random.default_rng(0)
    ranges = rng.uniform(0.9, 8.0, (len(t_ns), 90)).astype(np.float32)
    post = 0.8 + 0.005 * rng.standard_normal((len(t_ns), 4)).astype(np.float32)
    ranges[:, 10:14] = post
    ranges[::9, 10:14] = np.inf
    turns = drive((1.5, 1.3, 0.0), (Spin(3.0), Spin(-3.0), Spin(3.0)))
    straight = drive((1.5, 1.3, 0.0), (Follow(((13.0, 1.3),)),))

    def left(motion):
        return without_body(ranges, t_ns[0] + (t_ns - t_ns[0]) % int(motion.t_s[-1] * 1e9),
                            track_of(motion))  # fmt: skip

    cleaned = left(turns)
    assert np.isnan(cleaned[:, 10:14]).mean() == pytest.approx(8.0 / 9.0, abs=0.02)
    assert np.isnan(np.delete(cleaned, np.s_[10:14], axis=1)).sum() == 0
    # Along a wall a wall keeps its range, too: only who turns can tell.
    assert not np.isnan(left(straight)).any()
    assert without_body(ranges, t_ns, None) is ranges


def test_a_planar_lasers_cloud_is_all_scan(hall):
    """One ring, in the laser's own frame or in the base's."""
    ring = LayeredLidar(elevations=np.zeros(1), sigma_m=0.01, T_base_sensor=mount(z=0.15, yaw=0.0))
    t_s = np.array([0.0, 0.1])
    points = ring.sweeps(hall, standing(), t_s, np.random.default_rng(0))
    clouds = clouds_of(points, ring.sweep_s, t_s)
    in_base = clouds_of(points + ring.T_base_sensor[:3, 3], ring.sweep_s, t_s)

    own, _, _, setting = scans_of(clouds, ring.T_base_sensor)
    base = place_at(np.eye(4), frame="base_link", is_own_frame=False)
    moved = scans_of(in_base, np.eye(4), place=base)[0]

    assert np.quantile(off_by(own, cast(hall, standing()(t_s), ring, setting)), 0.95) < 0.03
    assert np.isfinite(moved).mean() > 0.95


def test_sparse_clouds_get_wider_beams(hall):
    lidar = LayeredLidar(azimuths=np.radians(np.arange(0.0, -360.0, -1.5)))
    points = lidar.sweeps(hall, standing(), np.array([0.0, 0.1]))

    setting = settle(clouds_of(points, lidar.sweep_s, [0.0, 0.1]), place_at(mount()), None)

    assert setting.increment == np.radians(2.0)


def test_flying_pixels_do_not_count_in_a_crowd(hall):
    camera = DepthCamera(sigma_m=0.005, pixels=(240, 180))
    room = rasterise(World((-4.0, -4.0, 4.0, 4.0), room_walls("w", (-4, -4, 4, 4))), 0.025,
                     as_map=False)  # fmt: skip
    points = camera.sweeps(
        room, standing((0.0, 0.0, 0.0)), np.array([0.0]), np.random.default_rng(0)
    )
    points[0, 90, 120] *= 0.3  # one pixel between an edge and what lies behind it

    ranges, _, _, setting = scans_of(clouds_of(points, camera.sweep_s, [0.0]), camera.T_base_sensor)

    assert setting.support == 3
    assert np.nanmin(ranges) > 2.5
