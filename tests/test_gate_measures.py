"""What a gate measures of a log: numbers with names, and reasons for those that are not there."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from posts import S, bare_post, lost_post
from scipy import stats

from slamreplay.bundle.run import Estimate, Run, Trial
from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.belief.jumps.found import Jump
from slamreplay.consistency.belief.jumps.steps import Step
from slamreplay.consistency.evidence.nees import nees
from slamreplay.errors import UsageError
from slamreplay.evidence.result import TrialResult
from slamreplay.gate.measures import mean_of
from slamreplay.gate.measuring import measures_of
from slamreplay.gate.metrics import METRICS, OF_TRIALS, metric_of
from slamreplay.verdict.judgement import Interval
from slamreplay.verdict.latency.spread import Spread


@pytest.fixture(scope="module")
def post():
    return lost_post()


@pytest.fixture(scope="module")
def measures(post):
    return measures_of(post)


def test_every_name_has_a_number_or_a_reason(post, measures):
    for told in (measures, measures_of(bare_post(post))):
        there = [{*told.values}, {*told.series}, {*told.missing}]
        assert set(METRICS) <= set.union(*there)
        assert sum(map(len, there)) == len(set.union(*there))  # never both
        assert all(told.missing.values())
        for name, one in told.values.items():
            assert one.unit == metric_of(name, ("amcl", "dead_reckoning")).unit
        for name, one in told.series.items():
            assert (METRICS[name].over_time, METRICS[name].unit) == (True, one.unit)


def test_units_stand_in_the_names():
    for name, metric in {**METRICS, **OF_TRIALS}.items():
        ends = {"m": "_m", "deg": "_deg", "s": "_s", "m2": "_m2"}
        assert (
            name.endswith(ends[metric.unit])
            if metric.unit
            else not name.endswith(tuple(ends.values()))
        )


def test_errors_and_times_are_those_of_the_log(measures):
    told = {name: one.value for name, one in measures.values.items()}

    assert told["error_max_m"] == pytest.approx(1.5)
    assert told["error_mean_m"] == pytest.approx(0.75)
    assert told["error_rmse_m"] == pytest.approx(np.sqrt(1.5**2 / 2.0))
    assert told["error_max_deg"] == pytest.approx(np.degrees(0.1))
    assert (told["lost_s"], told["lost_time_share"], told["duration_s"]) == (10.0, 0.5, 20.0)
    assert told["changed_area_m2"] == pytest.approx(1.9)
    assert (told["errors"], told["warnings"], told["stops"]) == (1, 1, 1)
    assert measures.series["error_m"].values.max() == pytest.approx(1.5)


def test_moments_that_the_verdict_does_not_judge_accuse_nobody(post):
    start, end = post.manifest.start_ns, post.manifest.end_ns
    half = start + 10 * S
    intervals = (Interval("healthy", start, half), Interval("insufficient_data", half, end))
    told = measures_of(replace(post, judgement=replace(post.judgement, intervals=intervals)))

    assert told.values["error_max_m"].value == pytest.approx(0.0, abs=1e-9)
    assert told.values["unjudged_share"].value == 0.5
    assert np.isnan(told.series["error_m"].values[110:]).all()
    assert np.isfinite(told.series["error_m"].values[:90]).all()
    # What the belief said of itself needs no judge.
    assert np.isfinite(told.series["sigma_m"].values).all()


def test_scans_that_hindsight_cannot_explain_accuse_nobody(post):
    match = np.where(np.arange(200) >= 100, 0.05, 0.8)
    told = measures_of(replace(post, hindsight=replace(post.hindsight, match=match)))

    assert told.values["error_max_m"].value < 1e-9


def test_what_is_missing_says_what_lacks(post):
    bare = measures_of(bare_post(post)).missing
    silent = measures_of(replace(post, belief=None, nees=None)).missing
    without = PoseTrack.without_covariance("map", "base_link", post.belief.t_ns, post.belief.xyyaw)
    unsure = measures_of(replace(post, belief=without, nees=None))

    assert (bare["error_max_m"], bare["error_m"], bare["changed_s"]) == ("no map",) * 3
    assert (silent["error_m"], silent["sigma_m"], silent["jumps"]) == ("no localizer spoke",) * 3
    assert unsure.missing["nees"] == "no covariance of the belief that could be used"
    assert "error_m" in unsure.series


def test_a_pose_that_was_set_is_no_jump_and_a_recovery_that_is_inferred_no_risk(post):
    def jump(metres, **how):
        step = Step(0, S, np.zeros(3), np.array([metres, 0.0, 0.0]), None)
        return Jump(step, "a scan", **how)

    jumps = ((Trial("b", "recorded", 0), (jump(0.4), jump(3.0, is_given=True))),)
    (acted,) = post.judgement.actions
    actions = (acted, replace(acted, inferred=True))
    track = post.hindsight.track
    told = measures_of(replace(post, jumps=jumps, odometry=track,
                               judgement=replace(post.judgement, actions=actions)))  # fmt: skip

    assert (told.values["jumps"].value, told.values["jump_max_m"].value) == (1.0, 0.4)
    assert told.values["risky_actions"].value == 1.0
    assert told.values["recoveries"].value == 2.0


@pytest.mark.parametrize(("basis", "known"), [("shared", True), ("relative", False)])
def test_ages_are_given_only_where_they_are_absolute(post, basis, known):
    """Only what the numbers look at is here."""
    usages = tuple(SimpleNamespace(pose=Spread(p95=p95), correction=Spread()) for p95 in (0.1, 0.3))
    latency = SimpleNamespace(clocks=SimpleNamespace(basis=basis))
    told = measures_of(replace(post, usages=usages, latency=latency))

    if known:
        assert told.values["pose_age_p95_s"].value == 0.3  # the worst consumer's
        assert "no use of a pose" in told.missing["correction_age_p95_s"]
    else:
        assert "not of one clock" in told.missing["pose_age_p95_s"]


def test_a_share_is_no_more_than_all():
    shares = np.where(np.arange(60) == 30, 0.9, 1.0)

    assert mean_of(shares, "", most=1.0).high == 1.0 < mean_of(shares, "").high


def test_a_mean_has_the_interval_of_its_effective_samples():
    """Against the textbook's t interval, which independent numbers have."""
    x = np.random.default_rng(3).gamma(4.0, 1.0, 400)
    one = mean_of(np.append(x, np.nan), "m")
    low, high = stats.t.interval(0.95, 399, loc=x.mean(), scale=stats.sem(x))

    assert one.value == x.mean()
    assert one.n_eff > 250.0
    assert (one.low, one.high) == (pytest.approx(low, rel=0.02), pytest.approx(high, rel=0.02))
    slow = mean_of(np.repeat(x[:20], 20), "m")  # the same twenty numbers over and over
    assert slow.n_eff < 40.0
    assert slow.high - slow.low > 2.0 * (one.high - one.low)


def test_the_factor_of_sigma_lies_in_its_interval(post):
    """Errors of twice the sigma that is claimed: the interval holds 2, and 4 for the mean."""
    t, where = post.belief.t_ns, post.hindsight.track
    sigma = np.sqrt(np.diagonal(post.belief.cov, axis1=1, axis2=2))
    error = 2.0 * np.sqrt(2.0) * sigma * np.random.default_rng(1).normal(size=(200, 3))
    belief = PoseTrack("map", "base_link", t, where.xyyaw + error, post.belief.cov)
    told = measures_of(replace(post, belief=belief, nees=nees(belief, where))).values

    for name, true in (("nees_factor", 2.0), ("nees_mean", 12.0), ("nees_factor_heading", 2.0)):
        assert told[name].low < true < told[name].high
        assert told[name].low < told[name].value < told[name].high
    assert told["nees_interval_ratio"].value > 1.0


def test_estimators_have_the_worst_of_their_seeds(post):
    track = post.hindsight.track
    runs = [
        TrialResult(
            Run(Trial("b", "amcl", seed), Estimate(track)),
            {"hindsight_max_m": error, "hindsight_max_rad": 0.1, "rows_with_pose": 200.0},
        )
        for seed, error in enumerate((0.2, 0.9, 0.4))
    ]
    disturbed = TrialResult(
        Run(Trial("b", "amcl", 0, "tf_delay.all", 0.2, "s"), Estimate(track)),
        {"hindsight_max_m": 5.0},
    )
    blind = TrialResult(
        Run(Trial("b", "ekf", 0), Estimate(track)), {"rows_with_pose": 0.0, "hindsight_max_m": None}
    )
    none = TrialResult(Run(Trial("b", "dead_reckoning", 0), None, "no odometry"))
    told = measures_of(replace(post, trials=(*runs, disturbed, blind, none)))

    assert told.values["amcl.error_max_m"].value == 0.9
    assert told.values["amcl.error_max_m"].of_seeds == (0.2, 0.9, 0.4)
    assert told.values["amcl.error_max_deg"].value == pytest.approx(np.degrees(0.1))
    assert told.values["ekf.error_max_m"].value == np.inf  # no belief is the worst
    assert told.missing["dead_reckoning.error_max_m"] == "no odometry"
    assert "independent updates" in told.missing["amcl.nees_mean"]


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("eror_max_m", "did you mean 'error_max_m'?"),
        ("amcl.error_m", "did you mean 'error_max_m'?"),
        ("ekf.error_max_m", "'estimators' names amcl"),
        ("x" * 1000, "there are: error_max_m"),
    ],
)
def test_a_name_that_there_is_not_gets_the_nearest(name, said):
    with pytest.raises(UsageError) as caught:
        metric_of(name, ("amcl",))

    assert said in str(caught.value)
    assert len(caught.value.what) < 200
