"""Motion, laser models, noise and matching of AMCL against plain numpy and scipy."""

from itertools import pairwise

import numpy as np
import pytest
from numba import njit
from scipy import stats

from slamreplay.estimators.amcl import noise
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.estimators.amcl.field import ScoreTable
from slamreplay.estimators.amcl.filter import AmclFilter
from slamreplay.estimators.amcl.laser import likelihood_table, used_beams
from slamreplay.estimators.amcl.match import ScanMatcher
from slamreplay.estimators.amcl.models import laser_model
from slamreplay.estimators.amcl.motion import drive, step_of
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.likelihood_field import distance_field
from slamreplay.maps.raycast import cast_rays

MOUNT = np.array([0.2, 0.0, 0.1])
BEARINGS = np.linspace(-2.3, 2.3, 47)
REACH = 12.0


def room() -> OccupancyGrid:
    cells = np.zeros((160, 200), dtype=np.int8)
    cells[[0, -1]] = 100
    cells[:, [0, -1]] = 100
    cells[60:75, 50:90] = 100
    cells[120:130, 20:60] = -1
    return OccupancyGrid(cells, 0.05, np.array([-3.0, 2.0, 0.4]))


ROOM = room()
HERE = se2.compose(ROOM.origin_xyyaw, np.array([5.0, 2.0, 0.3]))


def cloud(n: int = 300, sigma: float = 1.5) -> np.ndarray:
    """(3, N), some of it off the map."""
    off = np.random.default_rng(1).normal(0.0, [sigma, sigma, 2.0], (n, 3))
    return np.ascontiguousarray((HERE + off).T)


def scan(config: AmclConfig, at=HERE, bearings=BEARINGS):
    ranges = cast_rays(ROOM, se2.compose(at, MOUNT)[None], bearings, REACH)[0]
    ranges += np.random.default_rng(2).normal(0.0, 0.02, len(ranges))
    hit = np.isfinite(ranges)
    hit[::9] = False  # beams that saw nothing
    return used_beams(config, bearings, ranges, hit, MOUNT, REACH, ~hit)


@njit
def philox(particle, step, key0, key1):
    return noise.philox(particle, step, key0, key1)


@njit
def cos_sin(angles):
    out = np.empty((2, len(angles)))
    for i in range(len(angles)):
        out[0, i], out[1, i] = noise.cos_sin(angles[i])
    return out


def test_philox_gives_the_known_answers_of_random123():
    ones = 0xFFFFFFFF
    assert [hex(x) for x in philox(0, 0, 0, 0)] == [
        "0x5f6fb709", "0xd893f64", "0x4f121f81", "0x4f730a48",
    ]  # fmt: skip
    assert len({philox(p, s, k, ones) for p in (0, 1) for s in (0, 1) for k in (0, 1)}) == 8


def test_normals_are_normal_and_independent():
    drawn = np.empty((3, 40_000), dtype=np.float32)
    noise.normals(7, 1, 2, drawn)
    again, other = np.empty_like(drawn), np.empty((3, 10), dtype=np.float32)
    noise.normals(8, 1, 2, again)
    noise.normals(7, 1, 2, other)

    for row in drawn:
        assert stats.kstest(row, "norm").pvalue > 0.01
    together = np.corrcoef(np.vstack([drawn, again, drawn[:, ::-1]]))
    assert np.abs(together - np.eye(9)).max() < 0.02
    np.testing.assert_array_equal(other, drawn[:, :10])  # a number is of its particle alone


def test_cos_and_sin_are_those_of_numpy():
    angles = np.random.default_rng(0).uniform(-9.0, 9.0, 10_000)

    np.testing.assert_allclose(cos_sin(angles), [np.cos(angles), np.sin(angles)], atol=3e-16)


def test_differential_motion_turns_drives_and_turns():
    c = AmclConfig(alpha1=0.1, alpha2=0.2, alpha3=0.3, alpha4=0.4)
    delta, old_yaw = np.array([0.3, 0.4, 0.2]), 0.5
    noisy = np.random.default_rng(2).normal(size=(3, 300)).astype(np.float32)
    before = cloud()

    after = before.copy()
    drive(after, step_of(c, old_yaw, delta).numbers, noisy)

    first = np.arctan2(0.4, 0.3) - old_yaw
    last = 0.2 - first
    s1 = np.sqrt(0.1 * first**2 + 0.2 * 0.25)
    s2 = np.sqrt(0.1 * last**2 + 0.2 * 0.25)
    s3 = np.sqrt(0.3 * 0.25 + 0.4 * (first**2 + last**2))
    heading = before[2] + first + s1 * noisy[0]
    distance = 0.5 + s3 * noisy[1]
    expected = [
        before[0] + distance * np.cos(heading),
        before[1] + distance * np.sin(heading),
        se2.wrap_angle(heading + last + s2 * noisy[2]),
    ]
    np.testing.assert_allclose(after, expected, atol=1e-6)


def test_omnidirectional_motion_slides():
    c = AmclConfig(
        alpha1=0.1, alpha2=0.2, alpha3=0.3, alpha4=0.4, alpha5=0.5, motion_model="omnidirectional"
    )
    delta, old_yaw = np.array([0.3, 0.4, 0.2]), 0.5
    noisy = np.random.default_rng(2).normal(size=(3, 300)).astype(np.float32)
    before = cloud()

    after = before.copy()
    drive(after, step_of(c, old_yaw, delta).numbers, noisy)

    bearing = before[2] + np.arctan2(0.4, 0.3) - old_yaw
    along = 0.5 + np.sqrt(0.3 * 0.25 + 0.4 * 0.04) * noisy[1]
    across = np.sqrt(0.4 * 0.04 + 0.5 * 0.25) * noisy[2]
    expected = [
        before[0] + along * np.cos(bearing) + across * np.sin(bearing),
        before[1] + along * np.sin(bearing) - across * np.cos(bearing),
        se2.wrap_angle(before[2] + 0.2 + np.sqrt(0.1 * 0.04 + 0.2 * 0.25) * noisy[0]),
    ]
    np.testing.assert_allclose(after, expected, atol=1e-6)


def test_ros_1_squares_the_noise_and_driving_backwards_is_no_noisier():
    def numbers(delta, **changed):
        return step_of(AmclConfig(**changed), 0.0, np.array(delta)).numbers

    squared = numbers([0.5, 0.0, 0.1], squared_motion_noise=True)
    plain = numbers([0.5, 0.0, 0.1])
    np.testing.assert_allclose(squared[3:5], plain[3:5] ** 2)
    np.testing.assert_allclose(numbers([-0.5, 0.0, 0.0])[3:], numbers([0.5, 0.0, 0.0])[3:])
    assert numbers([0.005, 0.005, 0.1])[0] == 0.0  # too short a step to have a bearing


def distances_at_ends(particles, ends):
    """(N, M) from the plain definition: the nearest wall's centre, 2 m off the map."""
    at = se2.transform_points(
        particles.T, np.broadcast_to(ends.T, (particles.shape[1], *ends.T.shape))
    )
    cell = ROOM.cell_of(at)
    inside = ROOM.inside(cell)
    cell[~inside] = 0
    return np.where(inside, distance_field(ROOM, 2.0)[cell[..., 0], cell[..., 1]], 2.0)


def likelihoods(config, particles, beams, *, is_converged=False):
    model = laser_model(config, ROOM, distance_field(ROOM, 2.0))
    return model(particles, beams, is_converged=is_converged)


def beam_likelihood(c, d):
    return c.z_hit * np.exp(-(d**2) / (2 * c.sigma_hit**2)) + c.z_rand / REACH


def test_likelihood_field_is_one_plus_the_cubes():
    c = AmclConfig()
    beams = scan(c)
    got, log_factor = likelihoods(c, cloud(), beams)

    expected = 1.0 + (beam_likelihood(c, distances_at_ends(cloud(), beams.ends)) ** 3).sum(axis=1)
    off = np.abs(got - expected)
    assert log_factor == 0.0
    assert np.quantile(off, 0.9) < 1e-4  # 16 bits; a float32 may fall into the next cell
    assert off.max() < 0.3
    assert expected.max() > 2.0


def test_likelihood_field_prob_is_the_product():
    c = AmclConfig(laser_model_type="likelihood_field_prob", max_beams=30)
    beams = scan(c)
    got, log_factor = likelihoods(c, cloud(), beams)

    logs = np.log(beam_likelihood(c, distances_at_ends(cloud(), beams.ends))).sum(axis=1)
    off = np.abs(np.log(got) + log_factor - logs)
    assert np.quantile(off, 0.9) < 2e-3
    assert off.max() < 4.0
    assert got.max() == 1.0


def test_beams_that_most_particles_do_not_explain_are_skipped_once_converged():
    c = AmclConfig(
        laser_model_type="likelihood_field_prob", do_beamskip=True, max_beams=len(BEARINGS)
    )
    few = cloud(200, 0.02)
    few[2] = HERE[2]
    beams = scan(c)
    wrong = beams.ranges_m.copy()
    wrong[:10] = 1.0  # somebody stands there

    def with_ranges(ranges, **how):
        moved = type(beams)(beams.bearings, ranges, MOUNT, REACH)
        return likelihoods(c, few, moved, **how)

    (clean, clean_top), (hidden, hidden_top) = (
        with_ranges(r, is_converged=True) for r in (beams.ranges_m, wrong)
    )
    assert with_ranges(wrong)[1] < hidden_top - 10.0
    kept = np.s_[10:]
    alone = type(beams)(beams.bearings[kept], beams.ranges_m[kept], MOUNT, REACH)
    np.testing.assert_allclose(hidden, likelihoods(c, few, alone)[0])
    assert clean_top < hidden_top < 0.0
    assert clean.max() == 1.0
    all_wrong = np.full_like(wrong, 0.4)
    np.testing.assert_array_equal(
        with_ranges(all_wrong, is_converged=True)[0], with_ranges(all_wrong)[0]
    )


def test_beam_model_casts_rays_through_what_is_known_to_be_free():
    c = AmclConfig(laser_model_type="beam")
    beams, few = scan(c), cloud(40, 0.5)
    got, _ = likelihoods(c, few, beams)

    blocked = np.where(ROOM.free, 0, 100).astype(np.int8)
    walls = OccupancyGrid(blocked, ROOM.resolution_m, ROOM.origin_xyyaw)
    expected = cast_rays(walls, se2.compose(few.T, MOUNT), beams.bearings, REACH)
    inside = ROOM.inside(ROOM.cell_of(se2.compose(few.T, MOUNT)[:, :2]))
    expected = np.where(inside[:, None], np.minimum(expected, REACH), 0.0)
    z = beams.ranges_m - expected
    p = c.z_hit * np.exp(-(z**2) / (2 * c.sigma_hit**2))
    p += np.where(z < 0.0, c.z_short * c.lambda_short * np.exp(-c.lambda_short * beams.ranges_m), 0)
    p += np.where(beams.ranges_m >= REACH, c.z_max, c.z_rand / REACH)
    np.testing.assert_allclose(got, 1.0 + (p**3).sum(axis=1), rtol=1e-9)
    assert (beams.ranges_m == REACH).any()


def test_which_beams_are_used_follows_the_model():
    ranges = np.array([1.0, 0.1, 5.0, 20.0, 3.0, np.inf, np.nan, 4.0, 2.0])
    hit = np.isfinite(ranges)

    def used(**changed):
        c = AmclConfig(max_beams=9, laser_min_range=0.2, **changed)
        return used_beams(c, np.arange(9.0), ranges, hit, MOUNT, REACH, np.isinf(ranges))

    assert used().bearings.tolist() == [0, 2, 4, 7, 8]
    beam = used(laser_model_type="beam")
    assert beam.bearings.tolist() == [0, 1, 2, 3, 4, 5, 7, 8]
    assert beam.ranges_m.tolist() == [1.0, REACH, 5.0, REACH, 3.0, REACH, 4.0, 2.0]
    assert beam.returned.bearings.tolist() == [0, 2, 4, 7, 8]
    every = [
        len(
            used_beams(
                AmclConfig(max_beams=4, laser_model_type=m),
                *(np.ones((2, 10))),
                np.ones(10),
                MOUNT,
                9,
            )
        )
        for m in ("likelihood_field", "likelihood_field_prob")
    ]
    assert every == [4, 4]  # every third of ten beams by either rule


@pytest.mark.parametrize("beams", [0, 1, 15, 16, 17, 60])
def test_sums_are_the_same_in_any_order_and_for_any_number_of_beams(beams):
    scores = np.random.default_rng(4).random((30, 50))
    scores[[0, -1]] = scores[:, [0, -1]] = 0.25  # the border: what is off the map
    grid = OccupancyGrid(np.zeros((28, 48), dtype=np.int8), 0.1, np.array([0.3, -0.2, 0.7]))
    table = ScoreTable.of(scores, grid)
    ends = np.random.default_rng(3).normal(0.0, 2.0, (2, beams))
    particles = np.ascontiguousarray(
        se2.compose(
            grid.origin_xyyaw, np.random.default_rng(5).uniform([-1, -1, -3], [6, 4, 3], (70, 3))
        ).T
    )

    local = table.local(particles)
    got = table.sums(local, ends)

    turned = np.random.default_rng(6).permutation(beams)
    np.testing.assert_array_equal(got, table.sums(local, ends[:, turned]))
    np.testing.assert_array_equal(got[::-1], table.sums(np.ascontiguousarray(local[:, ::-1]), ends))
    x, y, c, s = local[..., None]
    col = np.clip(np.trunc(x + c * np.float32(ends[0]) - s * np.float32(ends[1])), 0, 49).astype(
        int
    )
    row = np.clip(np.trunc(y + s * np.float32(ends[0]) + c * np.float32(ends[1])), 0, 29).astype(
        int
    )
    expected = scores[row, col].sum(axis=1)
    assert np.quantile(np.abs(got - expected), 0.9) < 1e-3  # float32 may meet the next cell


def test_a_match_finds_the_pose_and_says_how_sure_the_scan_is():
    c = AmclConfig(max_beams=47)
    matcher = ScanMatcher(c, ROOM, distance_field(ROOM, 2.0))
    ends = scan(c).ends

    found = matcher(HERE + np.array([[0.15, -0.1, 0.08], [-0.1, 0.1, -0.1]]), [ends, ends])

    off = se2.between(HERE, found.xyyaw)
    assert (np.hypot(off[:, 0], off[:, 1]) < 0.04).all()
    assert (np.abs(off[:, 2]) < 0.02).all()
    assert (found.score > 0.9).all()
    assert (np.sqrt(np.diagonal(found.cov, axis1=1, axis2=2)) < [0.05, 0.05, 0.03]).all()
    assert np.linalg.eigvalsh(found.cov).min() > 0.0


def test_a_corridor_leaves_the_way_along_it_open():
    cells = np.zeros((60, 1000), dtype=np.int8)
    cells[[10, 50]] = 100
    corridor = OccupancyGrid(cells, 0.05, np.array([0.0, 0.0, 0.6]))
    c = AmclConfig(max_beams=47)
    here = se2.compose(corridor.origin_xyyaw, np.array([25.0, 1.5, 0.0]))
    ranges = cast_rays(corridor, here[None], BEARINGS, 8.0)[0]
    beams = used_beams(c, BEARINGS, ranges, np.isfinite(ranges), np.zeros(3), 8.0)

    found = ScanMatcher(c, corridor, distance_field(corridor, 2.0))(
        se2.compose(here, np.array([[0.3, 0.1, 0.0]])), [beams.ends]
    )
    cov = found.cov[0, :2, :2]

    along = np.array([np.cos(0.6), np.sin(0.6)])
    across = np.array([-along[1], along[0]])
    assert np.sqrt(along @ cov @ along) > 0.8
    assert np.sqrt(across @ cov @ across) < 0.05
    assert abs(se2.between(here, found.xyyaw[0])[1]) < 0.03


def test_a_match_without_beams_or_beginning_is_unknown():
    matcher = ScanMatcher(AmclConfig(), ROOM, distance_field(ROOM, 2.0))

    found = matcher(np.array([HERE, np.full(3, np.nan)]), [np.empty((2, 0)), np.ones((2, 5))])

    assert np.isnan(found.xyyaw).all()
    assert np.isnan(found.cov).all()
    assert np.isnan(found.score).all()


def test_nothing_is_published_between_resamplings():
    amcl = AmclFilter(AmclConfig(resample_interval=2), ROOM, 1)
    amcl.initialise(HERE, np.diag([0.04, 0.04, 0.01]))
    said = [amcl.published]
    for k in range(4):
        amcl.predict([0.3 * k, 0.0, 0.0])
        amcl.correct(scan(AmclConfig()))
        said.append(amcl.published)

    assert [a is b for a, b in pairwise(said)] == [True, False, True, False]


def test_selective_resampling_keeps_a_cloud_that_is_good_enough():
    amcl = AmclFilter(AmclConfig(selective_resampling=True), ROOM, 1)
    amcl.initialise(HERE, np.diag([1e-6, 1e-6, 1e-8]))
    before = amcl.particles.copy()
    amcl.predict(np.zeros(3))
    amcl.correct(scan(AmclConfig()))

    np.testing.assert_array_equal(amcl.particles, before)
    assert np.ptp(amcl.weights) > 0.0
    assert likelihood_table(AmclConfig(), distance_field(ROOM, 2.0), REACH).shape == (162, 202)
