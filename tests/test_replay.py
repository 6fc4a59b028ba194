"""Trials are designed, run, cached, and written so that they read back."""

import json

import numpy as np
import pytest

from slamreplay.bundle.run import Run, Trial, read_run, run_bytes
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.store import write_bundle
from slamreplay.bundle.view import Bundle
from slamreplay.errors import BundleError, OutputError, UsageError
from slamreplay.estimators.dead_reckoning import DeadReckoning
from slamreplay.replay import one_trial, parallel, run_cache, runner
from slamreplay.replay.design import design, parse_perturbation
from slamreplay.replay.folder import is_runs, read_runs, write_runs
from slamreplay.replay.metrics import trial_metrics
from slamreplay.testing.synthetic import synthetic_bundle


@pytest.fixture(scope="module")
def bundle(tmp_path_factory) -> Bundle:
    made, path = synthetic_bundle(seconds=8.0), tmp_path_factory.mktemp("log") / "b"
    tables = {name: made.table(name) for name in TABLES}
    write_bundle(path, made.manifest, tables, {"room": made.grid()})
    return Bundle.open(path)


def test_design_puts_baselines_first_and_one_perturbation_in_each_trial(bundle):
    trials = design(bundle, ["amcl", "dead_reckoning"], ["tf_delay=0.2", "scan_drop.even=0.5"], 7)

    assert [(t.estimator, t.perturbation, t.level, t.unit) for t in trials] == [
        ("amcl", None, None, ""),
        ("dead_reckoning", None, None, ""),
        ("amcl", "tf_delay.odometry", 0.2, "s"),
        ("dead_reckoning", "tf_delay.odometry", 0.2, "s"),
        ("amcl", "scan_drop.even", 0.5, "ratio"),
        ("dead_reckoning", "scan_drop.even", 0.5, "ratio"),
    ]
    assert {t.seed for t in trials} == {7}
    assert len({t.id for t in trials}) == 6


def test_design_without_perturbations_is_the_baseline_alone(bundle):
    assert len(design(bundle, ["amcl"], [], 0)) == 1


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("tf_delay", "no number"),
        ("tf_delay=", "no number"),
        ("tf_delay=fast", "no number"),
        ("tf_delay=nan", "0 to 60 s"),
        ("tf_delay=-1", "0 to 60 s"),
        ("tf_dely=1", "did you mean 'tf_delay'"),
        ("scan_drop.often=1", "scan_drop.random"),
        ("=1", "no perturbation"),
    ],
)
def test_perturbations_that_make_no_sense_are_refused(text, says):
    with pytest.raises(UsageError, match=says):
        parse_perturbation(text)


def test_unknown_estimators_and_seeds_are_refused(bundle):
    with pytest.raises(UsageError, match="amcl"):
        design(bundle, ["amlc"], [], 0)
    with pytest.raises(UsageError, match="no estimator"):
        design(bundle, [], [], 0)
    with pytest.raises(UsageError, match="negative"):
        design(bundle, ["amcl"], [], -1)


def test_a_setting_the_estimator_lacks_is_not_applicable_and_never_a_baseline(bundle):
    trials = design(bundle, ["dead_reckoning"], ["initial_pose.global=1"], 0)

    baseline, unmet = runner.replay(bundle, trials)

    assert baseline.estimate is not None
    assert unmet.estimate is None
    assert "initial_pose_global" in str(unmet.not_applicable)


def test_what_the_log_lacks_is_not_applicable():
    log = synthetic_bundle(seconds=2.0, with_map=False)

    runs = runner.replay(log, design(log, ["amcl", "dead_reckoning"], [], 0))

    assert "map" in str(runs[0].not_applicable)
    assert runs[1].not_applicable is None


def test_same_trial_gives_same_bytes_and_a_perturbed_one_does_not(bundle):
    trials = design(bundle, ["amcl"], ["scan_drop=0.5", "scan_drop=0.0"], 3)

    once, again = (runner.replay(bundle, trials) for _ in range(2))

    assert [run_bytes(r) for r in once] == [run_bytes(r) for r in again]
    baseline, dropped, level_zero = (r.estimate.track for r in once)
    assert baseline.xyyaw.tobytes() == level_zero.xyyaw.tobytes()
    assert len(dropped) < 0.8 * len(baseline)


def test_a_trial_of_another_bundle_is_refused(bundle):
    with pytest.raises(UsageError, match="another bundle"):
        runner.replay(bundle, [Trial("other", "amcl", 0)])


def test_second_time_comes_from_the_cache_and_damage_is_computed_again(
    bundle, tmp_path, monkeypatch
):
    trials = design(bundle, ["dead_reckoning"], ["tf_delay=0.2"], 0)
    first = runner.replay(bundle, trials, cache=tmp_path / "c")
    files = sorted((tmp_path / "c").iterdir())
    files[0].write_bytes(b"damaged")
    computed = []
    fresh = runner.run_trial
    monkeypatch.setattr(runner, "run_trial", lambda b, t: computed.append(t) or fresh(b, t))

    second = runner.replay(bundle, trials, cache=tmp_path / "c")

    assert len(files) == 2
    assert len(computed) == 1
    assert [run_bytes(r) for r in second] == [run_bytes(r) for r in first]


def test_the_cache_does_not_answer_after_the_code_changed(bundle, tmp_path, monkeypatch):
    trials = design(bundle, ["dead_reckoning"], [], 0)
    runner.replay(bundle, trials, cache=tmp_path)
    monkeypatch.setattr(run_cache, "_code", lambda: "other code")

    runner.replay(bundle, trials, cache=tmp_path)

    assert len(list(tmp_path.iterdir())) == 2


def test_progress_ends_at_one(bundle):
    told = []
    runner.replay(
        bundle,
        design(bundle, ["dead_reckoning"], [], 0),
        progress=lambda what, share: told.append((what, share)),
    )

    what = "dead_reckoning, baseline"
    assert told == [(what, 0.0), (what, 1.0), ("replayed", 1.0)]


def test_workers_give_the_same_bits_and_leave_runs_in_the_cache(tmp_path):
    made = synthetic_bundle(seconds=4.0)
    write_bundle(tmp_path / "b", made.manifest, {n: made.table(n) for n in TABLES}, {})
    bundle = Bundle.open(tmp_path / "b")
    trials = design(bundle, ["dead_reckoning"], ["scan_drop=0.5", "tf_delay=0.1"], 3)

    shared = runner.replay(bundle, trials, workers=2, cache=tmp_path / "c")
    alone = runner.replay(bundle, trials, workers=1)
    assert [run_bytes(run) for run in shared] == [run_bytes(run) for run in alone]
    assert len(list((tmp_path / "c").iterdir())) == 3
    without = runner.replay(bundle, trials, workers=2)
    assert [run_bytes(run) for run in without] == [run_bytes(run) for run in alone]


def test_the_fault_of_a_trial_shows_though_a_worker_met_it(tmp_path, monkeypatch):
    made = synthetic_bundle(seconds=4.0)
    write_bundle(tmp_path / "b", made.manifest, {n: made.table(n) for n in TABLES}, {})
    bundle = Bundle.open(tmp_path / "b")
    trial = Trial(bundle.manifest.bundle_id, "no_such_estimator", 0)

    with pytest.raises(UsageError, match="no_such_estimator"):
        runner.replay(bundle, [trial, trial], workers=2)


def test_a_short_log_needs_no_workers(bundle):
    assert parallel.worth_workers(bundle, [Trial("", "a", 0), Trial("", "b", 0)]) == 1


def test_runs_read_back_with_their_bundle(bundle, tmp_path):
    runs = runner.replay(
        bundle, design(bundle, ["dead_reckoning"], ["initial_pose.global=1", "tf_delay=1"], 0)
    )
    write_runs(tmp_path / "R", bundle, runs)

    beneath, back = read_runs(tmp_path / "R")

    assert is_runs(tmp_path / "R")
    assert not is_runs(tmp_path)
    assert beneath.manifest == bundle.manifest
    assert [run_bytes(r) for r in back] == [run_bytes(r) for r in runs]
    assert back[1].not_applicable == runs[1].not_applicable


def test_a_folder_can_hold_its_bundle_and_be_written_again(bundle, tmp_path):
    runs = runner.replay(bundle, design(bundle, ["dead_reckoning"], [], 0))
    write_runs(tmp_path / "R", bundle, runs, keep_bundle=True)
    (tmp_path / "R").rename(tmp_path / "moved")

    kept, back = read_runs(tmp_path / "moved")
    write_runs(tmp_path / "moved", kept, back)

    assert len(read_runs(tmp_path / "moved")[0].table("scans")) == 80
    assert json.loads((tmp_path / "moved" / "runs.json").read_text())["bundle"] == "bundle"


def test_a_run_cut_short_anywhere_is_refused_and_one_in_the_cache_made_again(bundle, tmp_path):
    cache = tmp_path / "cache"
    trial = design(bundle, ["dead_reckoning"], [], 0)
    (run,) = runner.replay(bundle, trial, cache=cache)
    (file,) = cache.glob("*.npz")
    whole = file.read_bytes()

    for size in (*range(8), *range(8, len(whole), len(whole) // 20)):
        file.write_bytes(whole[:size])
        with pytest.raises(BundleError, match="not a readable run"):
            read_run(file)

    (again,) = runner.replay(bundle, trial, cache=cache)
    assert run_bytes(again) == run_bytes(run) == file.read_bytes()


def test_damaged_and_foreign_folders_are_refused(bundle, tmp_path):
    runs = runner.replay(bundle, design(bundle, ["dead_reckoning"], [], 0))
    write_runs(tmp_path / "R", bundle, runs)
    run_file = next((tmp_path / "R" / "runs").iterdir())
    run_file.write_bytes(run_bytes(Run(Trial("x", "amcl", 0), None, "why")))
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("keep")

    with pytest.raises(BundleError, match="another trial"):
        read_runs(tmp_path / "R")
    with pytest.raises(BundleError, match="not a folder of runs"):
        read_runs(tmp_path / "mine")
    with pytest.raises(OutputError):
        write_runs(tmp_path / "mine", bundle, runs)
    with pytest.raises(OutputError, match="not on disk"):
        write_runs(tmp_path / "n", synthetic_bundle(seconds=1.0), [])


def test_metrics_are_zero_at_the_baseline_and_grow_with_the_level(bundle):
    texts = ["initial_pose=0.5", "initial_pose=2", "initial_pose.global=1"]
    runs = runner.replay(bundle, design(bundle, ["dead_reckoning"], texts, 0))

    baseline, near, far, unmet = (trial_metrics(run, runs, bundle) for run in runs)

    assert baseline["baseline_max_m"] == 0.0
    assert near["baseline_median_m"] == pytest.approx(0.5)
    assert far["baseline_final_m"] == pytest.approx(2.0)
    assert far["baseline_max_rad"] == pytest.approx(0.0, abs=1e-12)
    assert baseline["reference_rmse_m"] < 0.3 < 1.5 < far["reference_rmse_m"]
    assert baseline["rows"] == 80
    assert set(unmet.values()) == {None}
    assert all(v is None or np.isfinite(v) for v in near.values())


def test_an_estimator_whose_arithmetic_breaks_down_says_so_and_the_others_go_on(monkeypatch):
    class Singular(DeadReckoning):
        def run(self, view, *, seed):
            raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr(one_trial, "configured", lambda name, parameters: Singular())

    run = one_trial.run_trial(synthetic_bundle(seconds=2.0), Trial("b", "dead_reckoning", 0))

    assert run.estimate is None
    assert run.not_applicable == "dead_reckoning: its arithmetic broke down (Singular matrix)"
