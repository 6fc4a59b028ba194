"""The quantile of a scan among those that the particle filter predicts."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chisquare

from slamreplay.bundle.run import Run, Trial
from slamreplay.consistency.asking import ask
from slamreplay.consistency.context import CheckContext
from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.estimators.amcl.estimator import Amcl
from slamreplay.estimators.amcl.laser import used_beams
from slamreplay.estimators.amcl.scan_quantile import DRAWS, ScanQuantile
from slamreplay.estimators.start import OFFSET, ROTATE
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.likelihood_field import distance_field
from slamreplay.maps.raycast import cast_rays
from slamreplay.testing.synthetic import MOUNT_XYYAW, room_grid, synthetic_bundle

ROOM = room_grid()
HERE = se2.compose(ROOM.origin_xyyaw, np.array([3.0, 3.0, 0.3]))
ELSEWHERE = se2.compose(ROOM.origin_xyyaw, np.array([9.0, 7.0, 2.5]))
BEARINGS = np.linspace(-2.2, 2.2, 60)
SHARP = AmclConfig(sigma_hit=0.1, z_hit=0.95, z_rand=0.05)


def quantile_of(config, grid=ROOM, seed=0):
    return ScanQuantile(config, grid, distance_field(grid, config.laser_likelihood_max_dist), seed)


def cloud(rng, n=600):
    weights = rng.random(n)
    return HERE + rng.normal(0.0, [0.15, 0.1, 0.05], (n, 3)), weights / weights.sum()


def scan(config, ranges_m):
    return used_beams(config, BEARINGS, ranges_m, np.isfinite(ranges_m), MOUNT_XYYAW, 10.0)


def seen_from(pose, noise=0.01, seed=0):
    ranges = cast_rays(ROOM, se2.compose(pose, MOUNT_XYYAW)[None], BEARINGS, 10.0)[0]
    return ranges + noise * np.random.default_rng(seed).standard_normal(len(BEARINGS))


@pytest.mark.parametrize("config", [AmclConfig(), SHARP], ids=["nav2", "sharp"])
def test_scans_of_the_filters_own_model_have_even_quantiles(config):
    # Scans are made here from the model's words alone: a particle, a wall with noise, or anywhere.
    rng, quantile = np.random.default_rng(1), quantile_of(config)
    ranks = []
    for _ in range(600):
        particles, weights = cloud(rng)
        true = particles[rng.choice(len(particles), p=weights)]
        ranges = seen_from(true, config.sigma_hit, rng.integers(2**31))
        is_random = rng.random(len(BEARINGS)) < config.z_rand / (config.z_hit + config.z_rand)
        ranges = np.where(is_random, rng.uniform(0.0, 10.0, len(BEARINGS)), np.abs(ranges))
        ranks.append(quantile(particles, weights, scan(config, ranges)) * (DRAWS + 1) - 0.5)

    counts = np.bincount(np.rint(ranks).astype(int), minlength=DRAWS + 1)
    assert chisquare(counts.reshape(5, -1).sum(axis=1)).pvalue > 0.01
    assert 0.02 < counts[0] / 600 < 0.09  # 0.05 is meant


def test_a_scan_from_elsewhere_is_the_least_likely_and_one_from_here_is_not():
    rng, quantile = np.random.default_rng(2), quantile_of(SHARP)
    lost = [quantile(*cloud(rng), scan(SHARP, seen_from(ELSEWHERE, seed=k))) for k in range(40)]
    here = [quantile(*cloud(rng), scan(SHARP, seen_from(HERE, seed=k))) for k in range(40)]

    assert max(lost) == 0.5 / (DRAWS + 1)
    assert min(here) > 0.2


def test_the_vague_model_of_nav2_is_surprised_by_nothing():
    # Half of the beams random, 0.2 m of noise: why silence of SR-CON-009 proves nothing there.
    rng, quantile = np.random.default_rng(2), quantile_of(AmclConfig())
    here = [quantile(*cloud(rng), scan(SHARP, seen_from(HERE, seed=k))) for k in range(40)]

    assert min(here) == (DRAWS + 0.5) / (DRAWS + 1)


def test_without_beams_or_walls_there_is_no_traceback():
    rng = np.random.default_rng(3)
    blank = OccupancyGrid(np.zeros((20, 20), dtype=np.int8), 0.05, np.zeros(3))

    assert np.isnan(quantile_of(SHARP)(*cloud(rng), scan(SHARP, np.full(60, np.inf))))
    assert 0.0 < quantile_of(SHARP, blank)(*cloud(rng), scan(SHARP, seen_from(HERE))) < 1.0
    certain = AmclConfig(z_hit=1.0, z_rand=0.0)
    assert 0.0 < quantile_of(certain)(*cloud(rng), scan(certain, seen_from(ELSEWHERE))) < 1.0
    deaf = AmclConfig(z_hit=0.0, z_rand=0.0)
    assert np.isnan(quantile_of(deaf)(*cloud(rng), scan(deaf, seen_from(HERE))))


@pytest.mark.parametrize("seed", [0, 1])
def test_a_lost_robots_scans_are_told_and_a_sound_ones_are_not(seed):
    config = replace(SHARP, alpha1=0.05, alpha2=0.05, alpha3=0.05, alpha4=0.05)
    view = synthetic_bundle(seconds=25.0).view()

    def asked(evidence):
        run = Run(Trial("", "amcl", seed), Amcl(config).run(evidence, seed=seed))
        context = CheckContext.of_run(run, (), view)
        return [f for f in ask([context], ["scan_likelihood"]) if f.severity != "info"]

    assert asked(view) == []
    (finding,) = asked(view.with_setting(OFFSET, 2.5).with_setting(ROTATE, 2.0))
    assert finding.id == "SR-CON-009"
    assert finding.value > 0.3


def test_the_estimate_is_the_same_to_the_bit_without_it():
    view = synthetic_bundle(seconds=6.0).view()
    with_it, again = (Amcl().run(view, seed=4) for _ in range(2))
    without = Amcl(judge_scans=False).run(view, seed=4)

    assert with_it.track.xyyaw.tobytes() == without.track.xyyaw.tobytes()
    assert with_it.track.cov.tobytes() == without.track.cov.tobytes()
    assert with_it.diagnostics["ess"].tobytes() == without.diagnostics["ess"].tobytes()
    quantile = with_it.diagnostics["likelihood_quantile"]
    assert quantile.tobytes() == again.diagnostics["likelihood_quantile"].tobytes()
    np.testing.assert_array_equal(np.isfinite(quantile), with_it.diagnostics["updated"] > 0)
    assert np.isnan(without.diagnostics["likelihood_quantile"]).all()
