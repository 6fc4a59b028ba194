"""The particle filter's loops do what plain numpy does, and the filter finds the robot."""

import numpy as np
import pytest

from slamreplay.errors import MapError, UsageError
from slamreplay.estimators.amcl import kernels
from slamreplay.estimators.amcl.cloud import histogram, moments
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.estimators.amcl.filter import AmclFilter
from slamreplay.estimators.amcl.heaps import cell_of, cluster_of_cells, published
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.raycast import cast_rays

MOUNT = np.array([0.2, 0.0, 0.0])
BEARINGS = np.linspace(-2.3, 2.3, 181)


def room() -> OccupancyGrid:
    cells = np.zeros((160, 200), dtype=np.int8)
    cells[[0, -1]] = 100
    cells[:, [0, -1]] = 100
    cells[60:75, 50:90] = 100
    cells[110:, 140:150] = 100
    return OccupancyGrid(cells, 0.05, np.array([-3.0, 2.0, 0.4]))


ROOM = room()


def in_room(x: float, y: float, yaw: float):
    return se2.compose(ROOM.origin_xyyaw, np.array([x, y, yaw]))


def particles(n: int = 300) -> np.ndarray:
    rng = np.random.default_rng(1)
    return in_room(4.0, 4.0, 0.0) + rng.normal(0.0, [1.5, 1.5, 2.0], (n, 3))


def scan(true):
    ranges = cast_rays(ROOM, se2.compose(true, MOUNT)[None], BEARINGS, 12.0)[0]
    return ranges, np.isfinite(ranges)


def drive(amcl: AmclFilter, start, steps: int):
    """A quarter circle with honest odometry; the last true pose."""
    true, odometry = np.array(start), np.array([7.0, -3.0, 2.0])
    for k in range(steps):
        if k:
            step = np.array([0.1, 0.0, 0.02])
            true, odometry = se2.compose(true, step), se2.compose(odometry, step)
        amcl.update(odometry, BEARINGS, *scan(true), MOUNT, 12.0)
    return true


@pytest.mark.parametrize("n", [1, 7, 1000])
def test_systematic_draws_each_row_as_often_as_its_weight_says(n):
    weights = np.random.default_rng(5).random(40)
    weights[[0, 17, 39]] = 0.0

    rows = kernels.systematic(np.cumsum(weights), 0.37, n)

    counts = np.bincount(rows, minlength=40)
    assert counts.sum() == n
    assert (np.abs(counts - n * weights / weights.sum()) < 1.0 + 1e-9).all()
    assert not counts[[0, 17, 39]].any()


def test_draw_takes_the_rows_of_systematic_resampling():
    weights = np.random.default_rng(5).random(40)
    cloud, out = np.random.default_rng(1).random((3, 40)), np.empty((3, 100))

    kernels.draw(cloud, weights, 0.37, out)

    rows = kernels.systematic(np.cumsum(weights), 0.37, 100)
    np.testing.assert_array_equal(out, cloud[:, rows])


def test_kld_size_follows_the_formula_of_fox():
    k, error, z = 100, 0.05, 0.99
    bins = np.arange(k)

    n = kernels.kld_size(bins, k, np.arange(1.0, k + 1), 0.1, 50, 10_000, error, z)

    a = 2.0 / (9.0 * (k - 1))
    assert n == int(np.ceil((k - 1) / (2 * error) * (1 - a + np.sqrt(a) * z) ** 3))


@pytest.mark.parametrize(("spread", "expected"), [(0.0, 50), (1.0, 200)])
def test_kld_size_keeps_to_its_limits(spread, expected):
    bins = (np.arange(1000) * spread).astype(np.int64)

    assert kernels.kld_size(bins, 1000, np.arange(1.0, 1001), 0.5, 50, 200, 0.05, 0.99) == expected


def test_clusters_join_touching_cells_and_headings_across_pi():
    cloud = np.array([[0.1, 0.1, 3.1], [0.6, 0.6, -3.1], [5.0, 0.1, 0.0], [5.0, 0.1, 1.0]])

    cells = kernels.cell_numbers(cloud, cloud[:, :2].min(axis=0))
    distinct, bins = np.unique(cells, return_inverse=True)
    labels = kernels.cluster_labels(distinct)[bins]

    assert labels[0] == labels[1]
    assert len(set(labels[1:].tolist())) == 3


@pytest.mark.parametrize("spread_m", [0.3, 3.0, 300.0])
def test_hashed_cells_and_clusters_are_those_of_sorted_ones(spread_m):
    cloud = np.random.default_rng(6).normal(0.0, [spread_m, spread_m, 1.0], (700, 3))
    cloud[:, 2] = se2.wrap_angle(cloud[:, 2])
    distinct, bins = histogram(cloud)

    cell = np.empty(len(cloud), dtype=np.int64)
    keys = cell_of(np.ascontiguousarray(cloud.T), cell)
    labels = cluster_of_cells(keys)[cell]

    assert len(keys) == len(distinct)
    assert len(np.unique(np.column_stack([cell, bins]), axis=0)) == len(keys)
    pairs = np.unique(np.column_stack([labels, kernels.cluster_labels(distinct)[bins]]), axis=0)
    assert len(pairs) == len(np.unique(labels)) == len(np.unique(pairs[:, 1]))


def test_two_heaps_are_two_clusters_and_a_stray_particle_is_none():
    amcl = AmclFilter(AmclConfig(min_particles=100, max_particles=1000), ROOM, 3)
    amcl.initialise(in_room(2.0, 1.5, 0.1), np.diag([0.01, 0.01, 0.001]))
    one = amcl.published.clusters
    heaps = amcl.particles.copy()
    heaps[:400, 0] += 4.0
    heaps[-1, 0] -= 4.0
    said = published(np.ascontiguousarray(heaps.T), amcl.weights)
    rows = np.s_[400:-1]

    assert (one, said.clusters) == (1, 2)
    np.testing.assert_allclose(said.mean_xyyaw[:2], heaps[rows, :2].mean(axis=0), atol=1e-9)
    own = moments(heaps, amcl.weights)
    np.testing.assert_allclose(own.cov, said.cov)
    np.testing.assert_allclose(own.cov[:2, :2], np.cov(heaps[:, :2].T, bias=True))
    assert own.cov[0, 0] > 3.0 > 100 * moments(heaps[rows], amcl.weights[rows]).cov[0, 0]


def test_filter_tracks_from_a_start_half_a_metre_off():
    amcl = AmclFilter(AmclConfig(alpha1=0.05, alpha2=0.05, alpha3=0.05, alpha4=0.05), ROOM, 3)
    start = in_room(2.0, 1.5, 0.1)
    amcl.initialise(np.add(start, [0.4, -0.3, 0.1]), np.diag([0.25, 0.25, 0.05]))

    true = drive(amcl, start, 60)

    error = se2.between(true, amcl.published.mean_xyyaw)
    assert np.hypot(*error[:2]) < 0.15
    assert abs(error[2]) < 0.1
    assert np.sqrt(amcl.cov[0, 0] + amcl.cov[1, 1]) < 0.4
    assert amcl.cov[0, 2] == amcl.cov[1, 2] == 0.0
    assert len(amcl.particles) < 2000
    assert 1.0 <= amcl.ess <= 2000.0


def test_filter_finds_itself_anywhere():
    amcl = AmclFilter(AmclConfig(max_particles=8000), ROOM, 1)
    amcl.initialise_globally()
    assert ROOM.free[tuple(ROOM.cell_of(amcl.particles[:, :2]).T)].all()

    true = drive(amcl, in_room(2.0, 1.5, 0.1), 60)

    assert np.hypot(*se2.between(true, amcl.published.mean_xyyaw)[:2]) < 0.4


def test_random_particles_come_back_when_the_likelihood_falls():
    config = AmclConfig(recovery_alpha_slow=0.001, recovery_alpha_fast=0.5)
    amcl = AmclFilter(config, ROOM, 1)
    start = in_room(2.0, 1.5, 0.1)
    amcl.initialise(start, np.diag([0.01, 0.01, 0.001]))
    amcl.update([0, 0, 0], BEARINGS, *scan(start), MOUNT, 12.0)
    assert np.ptp(amcl.particles[:, 0]) < 1.0

    amcl.update([0.3, 0, 0], BEARINGS, *scan(in_room(8.0, 6.5, 2.0)), MOUNT, 12.0)
    amcl.update([0.6, 0, 0], BEARINGS, *scan(in_room(8.0, 6.5, 2.0)), MOUNT, 12.0)

    assert np.ptp(amcl.particles[:, 0]) > 5.0


def test_same_seed_gives_same_bits_and_another_seed_does_not():
    clouds = []
    for seed in (5, 5, 6):
        amcl = AmclFilter(AmclConfig(), ROOM, seed)
        amcl.initialise(in_room(2.0, 1.5, 0.1), np.diag([0.1, 0.1, 0.05]))
        drive(amcl, in_room(2.0, 1.5, 0.1), 20)
        clouds.append(amcl.particles.tobytes())

    assert clouds[0] == clouds[1] != clouds[2]


def test_update_waits_for_motion_beyond_the_threshold():
    amcl = AmclFilter(AmclConfig(), ROOM, 1)
    pose = in_room(2.0, 1.5, 0.1)
    amcl.initialise(pose, np.zeros((3, 3)))
    moves = [[0, 0, 0], [0.24, 0.24, 0.0], [0.24, 0.24, 0.19], [0.26, 0, 0], [0.26, 0, 0.21]]

    updated = [amcl.update(m, BEARINGS, *scan(pose), MOUNT, 12.0) for m in moves]

    assert updated == [True, False, False, True, True]


def test_covariance_of_headings_is_circular_and_finite():
    amcl = AmclFilter(AmclConfig(), ROOM, 1)
    amcl.initialise([1.0, 2.0, np.pi], np.diag([0.0, 0.0, 0.04]))

    assert amcl.cov[2, 2] == pytest.approx(0.04, rel=0.1)
    assert abs(se2.wrap_angle(amcl.published.mean_xyyaw[2] - np.pi)) < 0.02

    amcl.initialise_globally()
    assert np.isfinite(amcl.cov).all()


@pytest.mark.parametrize(
    "wrong", [{"sigma_hit": 0.0}, {"alpha1": np.nan}, {"min_particles": 3000}, {"z_hit": -1.0}]
)
def test_impossible_parameters_are_refused(wrong):
    with pytest.raises(UsageError, match=next(iter(wrong))):
        AmclConfig(**wrong)


def test_global_start_needs_a_free_cell():
    solid = OccupancyGrid(np.full((4, 4), 100, dtype=np.int8), 0.05, np.zeros(3))
    with pytest.raises(MapError, match="free"):
        AmclFilter(AmclConfig(), solid, 1).initialise_globally()
