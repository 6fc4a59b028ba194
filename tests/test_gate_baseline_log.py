"""A baseline of a real simulated log, and runs on it that are worse for a known reason."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from slamreplay.bundle.run import Trial
from slamreplay.bundle.schema import TABLES
from slamreplay.gate.baseline import baseline_json, compare, kept_log, read_baseline
from slamreplay.gate.gated import runs_of
from slamreplay.gate.measuring import measures_of
from slamreplay.gate.rules import BaselineRules, Demands, Rules
from slamreplay.ingest.pipeline import ingest
from slamreplay.perturb import PERTURBATIONS
from slamreplay.postmortem import postmortem
from slamreplay.replay.runner import replay
from slamreplay.testing.edits import rebuilt

LOG = Path(__file__).resolve().parents[1] / "sample_logs" / "healthy_short.bag"
SEEDS = 10


def kept(bundle, runs=()):
    post = postmortem(bundle, runs, cause=False, scene=False)
    return kept_log(measures_of(post), post.manifest.sources, post.judgement.state)


@pytest.fixture(scope="module")
def bundle(tmp_path_factory):
    return ingest([LOG], tmp_path_factory.mktemp("baseline") / "a.bundle")


@pytest.fixture(scope="module")
def runs(bundle):
    demands = Demands("as before?", Rules(), estimators=("amcl",), seeds=SEEDS)
    return runs_of(demands, bundle, workers=1)


@pytest.fixture(scope="module")
def baseline(bundle, runs, tmp_path_factory):
    path = tmp_path_factory.mktemp("baseline") / "baseline.json"
    path.write_text(baseline_json({"a.bag": kept(bundle, runs)}), encoding="utf-8")
    return read_baseline(path)


def found(baseline, now):
    outcomes = compare(baseline, {"a.bag": now}, BaselineRules())["a.bag"]
    return {one.check.removeprefix("baseline/"): one for one in outcomes}


def test_the_same_log_twice_is_the_same_to_the_byte(baseline, bundle, runs):
    again = kept(bundle, runs)
    outcomes = found(baseline, again)
    numbers = [one for check, one in outcomes.items() if check not in ("log", "state")]
    assert baseline_json({"a.bag": again}) == baseline_json(baseline.logs)
    assert len(numbers) > 10
    assert all(one.message.startswith("no difference: the same") for one in numbers)
    assert len(baseline_json(baseline.logs)) < 8000


def test_wheels_that_scatter_fail_the_error_and_nothing_that_they_do_not_touch(baseline, bundle):
    noise = PERTURBATIONS.load("odometry_noise")
    view = noise().apply(bundle.view(), "distance", 0.3, np.random.default_rng(0))
    tables = {name: view.table(name) for name in noise.touches if name in TABLES}
    outcomes = found(baseline, kept(rebuilt(bundle, tables)))
    failed = {check for check, one in outcomes.items() if one.status == "failed"}
    assert "error_mean_m" in failed
    assert outcomes["error_mean_m"].value > 0.1
    assert failed <= {"error_mean_m", "state"}
    assert outcomes["sigma_mean_m"].message.startswith("no difference: the same")


def test_a_filter_with_too_few_particles_fails_over_its_seeds(baseline, bundle):
    """As a new version of it would: the trials bear no perturbation when they are measured."""
    few = [
        Trial(bundle.manifest.bundle_id, "amcl", seed, "particle_count.scale", 0.02, "ratio")
        for seed in range(SEEDS)
    ]
    worse = [
        replace(run, trial=replace(run.trial, perturbation=None, level=None, unit=""))
        for run in replay(bundle, few, workers=1)
    ]
    outcomes = found(baseline, kept(bundle, worse))
    assert outcomes["amcl.error_max_m"].status == "failed"
    assert "worse" in outcomes["amcl.error_max_m"].message
    assert outcomes["error_mean_m"].message.startswith("no difference: the same")
