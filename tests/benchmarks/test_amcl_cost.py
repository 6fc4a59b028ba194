"""AMCL beside numpy on the same machine in the same run: ratios, not milliseconds.

Run with: uv run pytest tests/benchmarks --benchmark-only
"""

import time

import numpy as np
import pytest

from slamreplay.estimators.amcl.config import AmclConfig
from slamreplay.estimators.amcl.estimator import Amcl
from slamreplay.estimators.amcl.filter import AmclFilter
from slamreplay.estimators.amcl.laser import used_beams
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.raycast import cast_rays
from slamreplay.testing.synthetic import synthetic_bundle

PARTICLES, BEAMS, CELLS, ROUNDS = 10_000, 180, 800, 30
BEARINGS = np.linspace(-2.35, 2.35, BEAMS)


@pytest.fixture(scope="module")
def hall() -> OccupancyGrid:
    rng = np.random.default_rng(0)
    cells = np.zeros((CELLS, CELLS), dtype=np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    for row, col, height, width in rng.integers([20, 20, 4, 4], [760, 760, 40, 40], (60, 4)):
        cells[row : row + height, col : col + width] = 100
    cells[380:420, 380:420] = 0
    return OccupancyGrid(cells, 0.05, np.array([-20.0, -20.0, 0.0]))


@pytest.mark.parametrize("model", ["likelihood_field", "likelihood_field_prob"])
@pytest.mark.parametrize("is_global", [False, True], ids=["converged", "global"])
def test_an_update_beside_numpy_take(benchmark, hall, model, is_global):
    """`extra_info` holds a whole update's time as a multiple of looking its cells up in numpy."""
    config = AmclConfig(
        min_particles=PARTICLES, max_particles=PARTICLES, max_beams=BEAMS, laser_model_type=model
    )
    ranges = cast_rays(hall, np.zeros((1, 3)), BEARINGS, 30.0)[0]
    beams = used_beams(config, BEARINGS, ranges, np.isfinite(ranges), np.zeros(3), 30.0)
    amcl = AmclFilter(config, hall, 1)

    def start():
        if is_global:
            amcl.initialise_globally()
        else:
            amcl.initialise(np.zeros(3), np.diag([0.02, 0.02, 0.005]))
        amcl.predict(np.zeros(3))
        return (), {}

    def update():
        amcl.predict(np.array([0.25, 0.0, 0.02]))
        amcl._weigh(beams)  # what it publishes is no part of an update
        amcl._resample()

    start()
    ends = se2.transform_points(
        amcl.particles, np.broadcast_to(beams.ends.T, (PARTICLES, BEAMS, 2))
    )
    row, col = np.moveaxis(np.clip(hall.cell_of(ends), 0, CELLS - 1), -1, 0)
    index = (row * CELLS + col).astype(np.int64).ravel()
    table = np.random.default_rng(0).random(CELLS * CELLS, dtype=np.float32)
    update()  # compiles
    taken = np.empty((ROUNDS, 2))
    for k in range(ROUNDS):
        start()
        before = time.thread_time()
        np.take(table, index)
        between = time.thread_time()
        update()
        taken[k] = between - before, time.thread_time() - between
    benchmark.pedantic(update, setup=start, rounds=3)

    peer_s, own_s = np.median(taken, axis=0)
    benchmark.extra_info["times_numpy_take"] = own_s / peer_s


def test_ten_minutes_of_a_log(benchmark):
    """CPU time of 6000 scans with 2000 particles and 60 beams, and what judging them adds."""
    view = synthetic_bundle(seconds=600.0).view()
    config = AmclConfig(min_particles=2000, max_particles=2000)

    def cpu_s(amcl: Amcl) -> float:
        before = time.process_time()
        amcl.run(view, seed=1)
        return time.process_time() - before

    bare_s, full_s = (
        min(cpu_s(Amcl(config, judge_scans=judged)) for _ in range(3)) for judged in (False, True)
    )
    benchmark.pedantic(Amcl(config).run, (view,), {"seed": 1}, rounds=1)

    benchmark.extra_info["cpu_s"] = full_s
    benchmark.extra_info["judging_adds"] = full_s / bare_s - 1.0
