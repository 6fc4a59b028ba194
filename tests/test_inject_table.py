"""The table of injected faults: truth from the definition, scores from the verdict."""

import numpy as np
import pytest

from slamreplay.bench import inject, moments, real_faults
from slamreplay.bench.injection import Injection
from slamreplay.bundle.scans import scan_set
from slamreplay.geometry.times import NS_PER_S
from slamreplay.testing.synthetic import START_NS, synthetic_bundle, true_path


@pytest.fixture(scope="module")
def log():
    view = synthetic_bundle(seconds=20.0).view()
    scans = scan_set(view)
    xyyaw = true_path((scans.t_ns - START_NS) / 1e9)
    n = len(scans)
    return real_faults.Recorded(view, scans.t_ns, xyyaw, scans, np.zeros(n), np.zeros(n, bool))


def test_nothing_done_makes_nothing_true(log):
    injection = Injection("none", log.view, START_NS)
    assert not moments.true_lost(injection.view, log.track_ns, log.xyyaw).any()


def test_a_moved_belief_is_lost_from_then_on(log):
    start = START_NS + 6 * NS_PER_S
    injection = inject.wrong_start(log.view, start, (0.9, 0.0, 0.0))
    lost = moments.true_lost(injection.view, log.track_ns, log.xyyaw)
    assert abs(log.track_ns[np.flatnonzero(lost)[0]] - start) < 0.6 * NS_PER_S
    assert lost[log.track_ns > start + NS_PER_S].all()


@pytest.mark.parametrize("make", [real_faults.appeared, real_faults.removed, real_faults.moved])
def test_chosen_edits_contradict_enough_beams_for_long_enough(log, make):
    for seed in (0, 1):
        rng = np.random.Generator(np.random.PCG64(seed))
        what, injection = make(log, rng)
        beams = real_faults.edited_beams(injection, log)
        assert (beams > 0.08).sum() > 20, what
        assert injection.view.grid.version != log.view.grid.version


def test_unedited_maps_contradict_no_beam(log):
    box = next(real_faults.seen_boxes(log, np.random.Generator(np.random.PCG64(0))))
    same = Injection("moved", log.view, START_NS, box, box)
    assert real_faults.edited_beams(same, log).max() == 0.0


def test_scores_leave_edges_and_uncounted_moments_out():
    t_ns = np.arange(100) * NS_PER_S // 10
    true, said = np.zeros(100, bool), np.zeros(100, bool)
    true[30:60], said[33:60], said[90:] = True, True, True
    every = np.ones(100, bool)
    score = moments.scored(t_ns, true, said, every)
    assert (score.hits, score.missed, score.false) == (19, 0, 10)  # 36 to 54, 90 to 99
    counted = every.copy()
    counted[95:] = False  # and so are those within half a second of what is not counted
    assert moments.scored(t_ns, true, said, counted).f1 == 1.0
    assert moments.scored(t_ns, ~every, ~every, every).f1 is None
