"""What trials share is found by identity, depends on nothing that is not named, changes no bit."""

import numpy as np
import pytest

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.run import run_bytes
from slamreplay.bundle.scans import scan_set
from slamreplay.bundle.sharing import MOST, Shared
from slamreplay.bundle.tables import Ragged
from slamreplay.estimators.amcl import estimator as amcl
from slamreplay.estimators.scan_matching import local
from slamreplay.replay.design import design
from slamreplay.replay.one_trial import run_trial
from slamreplay.testing.synthetic import synthetic_bundle

ESTIMATORS = ("dead_reckoning", "amcl", "scan_matching", "pose_graph", "pose_graph_online", "ekf")
CHANGES = (
    "tf_delay=0.2", "tf_delay.all=0.1", "scan_drop=0.4", "scan_delay=0.1", "odometry_scale=1.1",
    "initial_pose=0.3", "initial_pose.rotate=10",
)  # fmt: skip


def made(seconds=6.0):
    return synthetic_bundle(seconds=seconds)


@pytest.mark.parametrize("order", [1, -1])
def test_runs_are_the_same_bits_with_and_without_what_others_worked_out(order):
    together = made()
    trials = design(together, ESTIMATORS, CHANGES, 3)[::order]

    shared = {trial: run_bytes(run_trial(together, trial)) for trial in trials}

    for trial in trials:
        assert shared[trial] == run_bytes(run_trial(made(), trial)), trial


def test_scans_and_the_way_matched_along_them_are_worked_out_once(monkeypatch):
    bundle, counts = made(), {"matched": 0, "distances": 0}

    def counting(name, real):
        def counted(*args):
            counts[name] += 1
            return real(*args)

        return counted

    monkeypatch.setattr(local, "local_trajectory", counting("matched", local.local_trajectory))
    monkeypatch.setattr(amcl, "distance_field", counting("distances", amcl.distance_field))
    names = ["amcl", "pose_graph", "pose_graph_online", "scan_matching"]
    for trial in design(bundle, names, ["initial_pose=0.3", "initial_pose=1"], 0):
        run_trial(bundle, trial)
    assert counts == {"matched": 1, "distances": 1}

    for trial in design(bundle, ["pose_graph"], ["tf_delay=0.2"], 0):
        run_trial(bundle, trial)
    assert counts["matched"] == 2


def test_a_view_finds_what_was_made_of_the_tables_it_has_and_no_other():
    bundle = made(2.0)
    plain, again = bundle.view(), bundle.view()
    few = plain.with_table(plain.table("scans").take(np.arange(5)))

    assert scan_set(plain).ranges_m is scan_set(again.with_setting("any", 1.0)).ranges_m
    assert len(scan_set(few)) == 5
    assert scan_set(few).ranges_m is scan_set(few).ranges_m
    assert odometry_track(few) is odometry_track(plain)
    assert len(scan_set(plain)) == 20


def test_shared_work_can_read_only_what_it_names():
    view = made(2.0).view().with_setting("any", 1.0)

    with pytest.raises(AssertionError, match="reads odometry"):
        view.shared("x", ["scans"], lambda alone: alone.table("odometry"))
    with pytest.raises(AssertionError, match="reads map_updates"):
        view.shared("x", ["scans"], lambda alone: alone.grid)
    with pytest.raises(AssertionError, match="not shared"):
        view.shared("x", ["references"], lambda alone: 1)
    assert view.shared("x", ["scans"], lambda alone: dict(alone.settings)) == {}


def test_equal_objects_are_not_the_same_and_old_results_go():
    shared, a, b = Shared(), np.zeros(3), np.zeros(3)
    made_of = []

    def make(which):
        return lambda: made_of.append(which) or len(made_of)

    assert [shared.of("k", 0, [x], make("ab"[x is b])) for x in (a, b, a, b)] == [1, 2, 1, 2]
    assert shared.of("k", 1, [a], make("c")) == 3
    assert shared.of("other", 0, [a], make("d")) == 4
    assert shared.of("k", 0, [b], make("e")) == 2  # a was asked for before b
    assert shared.of("k", 0, [a], make("f")) == 5
    assert MOST == 2
    with pytest.raises(ZeroDivisionError):
        shared.of("fails", 0, [a], lambda: 1 // 0)
    assert shared.of("fails", 0, [a], lambda: 1) == 1


def test_scans_of_one_length_are_the_matrix_that_padding_gives():
    view = made(2.0).view()
    table = view.table("scans")
    ranges = table["ranges_m"]
    short = [ranges[k][: len(ranges[k]) - (k == 3)] for k in range(len(table))]

    whole, padded = scan_set(view), scan_set(view.with_table(table.replace(ranges_m=short)))

    assert np.isnan(padded.ranges_m[3, -1])
    same = np.arange(len(table)) != 3
    assert np.array_equal(whole.ranges_m[same], padded.ranges_m[same], equal_nan=True)
    assert whole.ranges_m.flags.writeable
    assert whole.ranges_m.flags.c_contiguous
    assert not np.shares_memory(whole.ranges_m, ranges.values)


@pytest.mark.parametrize("index", [[], [2], [3, 0, 0, 1], [-1, 1]])
def test_rows_of_one_length_are_taken_as_those_of_any(index):
    whole = Ragged.of(np.arange(20).reshape(4, 5), np.float32)
    index = np.array(index, dtype=np.int64)

    for rows in (whole, whole.rows(0, 4), Ragged.of([*whole, [1.0]], np.float32).rows(0, 4)):
        taken = rows.take(index)
        assert [row.tolist() for row in taken] == [whole[k % 4].tolist() for k in index]
        assert taken.values.dtype == np.float32
        assert taken.offsets.tolist() == [5 * k for k in range(len(index) + 1)]
