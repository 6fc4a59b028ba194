"""Matching, registration and ray casting beside peers in one run: ratios, whatever the machine.

Run with: uv run pytest tests/benchmarks/test_matching_cost.py --benchmark-only
As a table with the goals beside it: uv run python tests/benchmarks/test_matching_cost.py

One hall of 40 x 40 m at 5 cm; scans of 1081 beams over 270 degrees with 1 cm of noise. The peers
that take the plain way are part of this file or of the package; the others are their own makers'.
"""

import statistics
import sys
import time
from functools import cache
from pathlib import Path
from types import FunctionType

import numba
import numpy as np
import pytest
from numba import njit
from scipy.ndimage import distance_transform_edt

sys.path.insert(0, str(Path(__file__).parents[1]))
import plain_rays

from slamreplay.errors import NotApplicableError
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.raycast import cast_rays
from slamreplay.matching.branch_and_bound import PoseWindow, best_pose, heading_step
from slamreplay.matching.correlative import Window, match_each, search_window
from slamreplay.matching.field import working_map
from slamreplay.matching.icp import icp
from slamreplay.matching.line_target import line_target
from slamreplay.matching.open3d_icp import icp_open3d
from slamreplay.matching.pyramid import pyramid
from slamreplay.matching.thinning import thin
from slamreplay.simulate.halls import random_warehouse
from slamreplay.simulate.worlds import rasterise

BEARINGS = np.linspace(-np.radians(135.0), np.radians(135.0), 1081)
SIGMA_M, POINTS, NOISE_M, SCANS = 0.07, 217, 0.01, 12
REACH_M, REACH_RAD = 0.5, np.radians(20.0)


@cache
def hall(resolution_m=0.05):
    world = random_warehouse(np.random.default_rng(5), (40.0, 40.0))
    grid = rasterise(world, resolution_m, as_map=True)
    return OccupancyGrid(grid.cells, resolution_m, np.zeros(3))


@cache
def places():
    """Poses (SCANS, 3) half a metre from everything."""
    rng = np.random.default_rng(6)
    clear = np.argwhere(distance_transform_edt(hall().free) * 0.05 > 0.5)
    chosen = clear[rng.integers(len(clear), size=SCANS)][:, ::-1]
    return np.column_stack([(chosen + 0.5) * 0.05, rng.uniform(-np.pi, np.pi, SCANS)])


def scan_at(grid, pose, rng):
    reach = cast_rays(grid, pose, BEARINGS, 25.0)[0]
    seen = np.isfinite(reach)
    reach, bearing = reach[seen] + rng.normal(0.0, NOISE_M, seen.sum()), BEARINGS[seen]
    return np.column_stack([reach * np.cos(bearing), reach * np.sin(bearing)])


@cache
def searched():
    """Field and bounds, and for each scan thinned points, the true pose and a guess."""
    rng = np.random.default_rng(7)
    field = working_map(hall()).field(SIGMA_M)
    cases = []
    for pose in places():
        points, spacing = scan_at(hall(), pose, rng), 0.05
        thinned = thin(points, spacing)
        while len(thinned) > POINTS:
            spacing *= 1.05
            thinned = thin(points, spacing)
        cases.append((thinned, pose, pose + rng.uniform(-1.0, 1.0, 3) * (0.3, 0.3, 0.2)))
    return field, pyramid(field), cases


@cache
def registered():
    """Pairs of scans and the motion between them, seen on a grid of 1 cm."""
    rng = np.random.default_rng(8)
    grid, pairs = hall(0.01), []
    for pose in places():
        move = rng.uniform(-1.0, 1.0, 3) * (0.2, 0.2, 0.1)
        second = se2.compose(pose, move)
        pairs.append((scan_at(grid, pose, rng), scan_at(grid, second, rng), move))
    return pairs


def times(*works, cases, clock=time.process_time, runs=3):
    """Median seconds of each work over the cases, taken in turn, and what each found last."""
    spent, found = [[] for _ in works], [[None] * len(cases) for _ in works]
    for run in range(runs + 1):
        for k, case in enumerate(cases):
            for w, work in enumerate(works):
                before = clock()
                found[w][k] = work(*case)
                if run:  # the first run compiles
                    spent[w].append(clock() - before)
    return [statistics.median(s) for s in spent], found


def local(bounds, points, guess):
    return best_pose(bounds, points, PoseWindow(guess, (REACH_M, REACH_M), REACH_RAD))


def exhaustive(field, points, guess):
    step_rad = heading_step(points, field.resolution_m)
    return search_window(field, points, guess, Window(REACH_M, 0.05, REACH_RAD, step_rad))


def windows():
    """Local and whole-map search: times of the plain search and of both, and scans found."""
    field, bounds, cases = searched()
    (plain_s, local_s, whole_s), (plain, near, whole) = times(
        lambda points, _, guess: exhaustive(field, points, guess),
        lambda points, _, guess: local(bounds, points, guess),
        lambda points, *_: best_pose(bounds, points, PoseWindow.whole(field)),
        cases=cases,
    )
    # Where a point lies on the edge of two cells, rounding decides for each in its own way.
    for one, other in zip(plain, near, strict=True):
        assert other.score == pytest.approx(one[1], abs=0.01)
    truth = [pose for _, pose, _ in cases]
    found = sum(np.abs(w.xyyaw[:2] - t[:2]).max() < 0.1 for w, t in zip(whole, truth, strict=True))
    return plain_s, local_s, whole_s, found


def gicp(first, second):
    import small_gicp

    flat = [np.column_stack([p, np.zeros(len(p))]) for p in (first, second)]
    # A leaf this small keeps every point, as ours does.
    T = small_gicp.align(
        *flat, registration_type="GICP", num_threads=1, downsampling_resolution=1e-4
    ).T_target_source
    return np.array([T[0, 3], T[1, 3], np.arctan2(T[1, 0], T[0, 0])])


def pairwise(peer):
    """Seconds of ours and of a peer, and the median error of each, m; targets are made anew."""
    pairs = registered()
    (own_s, peer_s), found = times(
        lambda a, b, _: icp(line_target(a), b, np.zeros(3)).xyyaw,
        lambda a, b, _: peer(a, b),
        cases=pairs,
    )
    moves = np.array([move for *_, move in pairs])
    errors = [float(np.median(np.hypot(*(np.array(f) - moves)[:, :2].T))) for f in found]
    return own_s, peer_s, *errors


def rays():
    """Seconds of ours and of the plain walk, compiled, over every beam of every scan."""
    grid = hall()
    walk = njit(plain_rays.first_wall)
    scope = {**plain_rays.cast.__globals__, "first_wall": walk}
    cast = njit(FunctionType(plain_rays.cast.__code__, scope))

    def plain():
        out = np.empty((SCANS, len(BEARINGS)))
        cast(grid.occupied, grid.resolution_m, places(), BEARINGS, 25.0, out)
        return out

    (plain_s, own_s), (theirs, ours) = times(
        plain, lambda: cast_rays(grid, places(), BEARINGS, 25.0), cases=[()], runs=15
    )
    assert theirs[0].tobytes() == ours[0].tobytes()
    return plain_s, own_s


def threads():
    """Seconds of wall for many matches on one thread and on two; what they find is the same.

    Then those of CPU: on a busy machine only they tell whether two threads get in each other's way.
    """
    field, _, cases = searched()
    clouds = [points for points, *_ in cases] * 20
    guesses = np.array([guess for *_, guess in cases] * 20)
    window = Window(0.2, 0.05, 0.1, 0.01)

    def on(count):
        numba.set_num_threads(count)
        return match_each(field, clouds, guesses, window)

    before = numba.get_num_threads()
    try:
        work = (lambda: on(1), lambda: on(2))
        wall_s, (one, two) = times(*work, cases=[()], clock=time.perf_counter, runs=7)
        cpu_s, _ = times(*work, cases=[()], runs=5)
    finally:
        numba.set_num_threads(before)
    assert one[0].xyyaw.tobytes() == two[0].xyyaw.tobytes()
    assert one[0].information.tobytes() == two[0].information.tobytes()
    return *wall_s, *cpu_s


def test_local_match(benchmark):
    """`extra_info` holds how many times less than scoring every pose of the window."""
    _, bounds, cases = searched()
    plain_s, local_s, _, _ = windows()
    benchmark(local, bounds, cases[0][0], cases[0][2])
    benchmark.extra_info |= {"times_less": plain_s / local_s}
    assert plain_s > 4.0 * local_s


def test_whole_map(benchmark):
    """`extra_info` holds how many local matches one search of the whole map costs."""
    field, bounds, cases = searched()
    _, local_s, whole_s, found = windows()
    benchmark(best_pose, bounds, cases[0][0], PoseWindow.whole(field))
    benchmark.extra_info |= {"local_matches": whole_s / local_s, "found": found, "goal": 85}
    assert whole_s < 85.0 * local_s
    assert found == SCANS


def test_icp_beside_small_gicp(benchmark):
    pytest.importorskip("small_gicp", reason="small_gicp is not installed")
    own_s, peer_s, own_m, peer_m = pairwise(gicp)
    first, second, _ = registered()[0]
    benchmark(lambda: icp(line_target(first), second, np.zeros(3)))
    benchmark.extra_info |= {"times_less": peer_s / own_s, "goal": 2, "error_m": [own_m, peer_m]}
    assert peer_s > 2.0 * own_s
    assert own_m <= peer_m


def test_icp_beside_open3d(benchmark):
    first, second, _ = registered()[0]
    try:
        icp_open3d(line_target(first), second, np.zeros(3))
    except NotApplicableError as error:
        pytest.skip(str(error))
    own_s, peer_s, own_m, peer_m = pairwise(with_open3d)
    benchmark(lambda: icp_open3d(line_target(first), second, np.zeros(3)))
    benchmark.extra_info |= {"times_less": peer_s / own_s, "error_m": [own_m, peer_m]}
    assert peer_s > 1.5 * own_s
    assert own_m <= 1.2 * peer_m


def with_open3d(first, second):
    return icp_open3d(line_target(first), second, np.zeros(3)).xyyaw


def test_rays(benchmark):
    """`extra_info` holds our time as a share of the plain walk's."""
    plain_s, own_s = rays()
    benchmark(cast_rays, hall(), places(), BEARINGS, 25.0)
    benchmark.extra_info |= {"share": own_s / plain_s, "goal": 0.9}
    assert own_s < 0.95 * plain_s


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread is allowed")
def test_two_threads(benchmark):
    """`extra_info` holds how many times faster two threads are; other programs spoil it."""
    one_s, two_s, one_cpu_s, two_cpu_s = benchmark.pedantic(threads, rounds=1)
    benchmark.extra_info |= {"times_faster": one_s / two_s, "goal": 1.9}
    benchmark.extra_info |= {"cpu_of_two": two_cpu_s / one_cpu_s}
    assert two_cpu_s < 1.3 * one_cpu_s


def main():
    plain_s, local_s, whole_s, found = windows()
    print("| what | goal | measured | ms | peer's ms |\n|---|---|---|---|---|")

    def line(what, goal, measured, own_s, peer_s):
        print(f"| {what} | {goal} | {measured} | {own_s * 1e3:.2f} | {peer_s * 1e3:.2f} |")

    line("local match, against every pose scored", "", f"{plain_s / local_s:.1f}x faster",
         local_s, plain_s)  # fmt: skip
    line(f"whole map, {found} of {SCANS} found, against local matches", "at most 85",
         f"{whole_s / local_s:.1f}", whole_s, local_s)  # fmt: skip
    for name, peer in (("small_gicp GICP", gicp), ("Open3D, our lines", with_open3d)):
        try:
            own_s, peer_s, own_m, peer_m = pairwise(peer)
        except (ImportError, NotApplicableError) as error:
            print(f"| ICP against {name} | | {error} | | |")
            continue
        errors = f"error {own_m * 1e3:.1f} against {peer_m * 1e3:.1f} mm"
        line(f"ICP against {name}", "2x faster", f"{peer_s / own_s:.1f}x faster, {errors}",
             own_s, peer_s)  # fmt: skip
    plain_s, own_s = rays()
    each = SCANS * len(BEARINGS) * 1e-6
    line("a thousand rays, against the plain walk", "at most 0.9", f"{own_s / plain_s:.2f}",
         own_s / each * 1e-3, plain_s / each * 1e-3)  # fmt: skip
    one_s, two_s, one_cpu_s, two_cpu_s = threads()
    told = f"{one_s / two_s:.2f}x faster, {two_cpu_s / one_cpu_s:.2f} of its CPU time"
    line("240 matches on two threads, against one", "1.9x faster", told, two_s, one_s)


if __name__ == "__main__":
    main()
