"""What innovations say: of their size, of their memory, of a bias, and through a gate."""

from dataclasses import replace

import numpy as np
import pytest
from linear_filter import VIEW, filters, told
from scipy.stats import chi2, t, truncnorm, ttest_1samp

from slamreplay.bundle.run import Innovations
from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.asking import ask
from slamreplay.consistency.context import CheckContext
from slamreplay.consistency.innovations import innovation_bias
from slamreplay.consistency.innovations.innovation_bias import bias_of
from slamreplay.consistency.innovations.innovation_sets import innovation_sets
from slamreplay.consistency.innovations.nis import nis_tests
from slamreplay.consistency.innovations.whiteness import whiteness
from slamreplay.consistency.statistics.mean_test import mean_test
from slamreplay.consistency.statistics.truncation import SCALE_MAX, Truncation

GATE = chi2.ppf(0.99, 1)


def found(sets, id_, source="range"):
    """In how many runs the finding is raised of that source, other than as info."""
    return sum(
        any(f.id == id_ and f.severity != "info" and source in f.message for f in told(one))
        for one in sets
    )


# --- a filter of which everything is known ---------------------------------------------------


def test_a_tuned_filter_is_left_alone():
    accused = [f for one in filters(200) for f in told(one)]

    assert len(accused) <= 2, accused


def test_a_tuned_filter_behind_a_gate_is_left_alone():
    accused = [f for gate in (GATE, 3.0) for one in filters(20, gate=gate) for f in told(one)]

    assert len(accused) <= 1, accused


@pytest.mark.parametrize(
    ("defect", "id_", "source"),
    [
        ({"told_R": 0.5}, "SR-CON-006", "range"),
        ({"told_R": 2.0}, "SR-CON-006", "range"),
        ({"told_Q": 0.25}, "SR-CON-006", "position"),
        ({"told_Q": 0.25}, "SR-CON-007", "position"),
        ({"memory": 0.5}, "SR-CON-007", "range"),
        ({"memory": -0.5}, "SR-CON-007", "range"),
        ({"bias": 0.04}, "SR-CON-008", "range"),
    ],
)
def test_a_named_defect_is_found_and_the_right_sensor_named(defect, id_, source):
    assert found(filters(100, **defect), id_, source) >= 95


def test_half_of_r_is_told_as_what_it_is():
    ratios = [nis_tests(innovation_sets(one)[1]).joint.ratio for one in filters(40, told_R=0.5)]
    finding = next(f for f in told(filters(1, told_R=0.5)[0]) if f.id == "SR-CON-006")

    assert np.mean(ratios) == pytest.approx(np.sqrt(2.0), abs=0.03)
    assert (finding.severity, finding.unit) == ("warning", "1")
    assert finding.low < 1.0 < finding.high < finding.value
    assert "kf: the innovations of range are 1.3" in finding.message
    assert "R and the process noise Q are together too small by a factor of 1.9" in finding.message


def test_the_sign_of_the_correlation_tells_q_from_r():
    def first(seen):
        return whiteness(innovation_sets(seen)[0].white).rho[:, 0].mean()

    assert np.mean([first(one) for one in filters(20, told_Q=0.25)]) > 0.15
    assert np.mean([first(one) for one in filters(20, told_Q=4.0)]) < -0.1
    slow, fast = told(filters(1, told_Q=0.25)[0]), told(filters(1, told_Q=16.0)[0])
    assert any("Q too small beside R" in f.message for f in slow if f.id == "SR-CON-007")
    assert any("R too small beside Q" in f.message for f in fast if f.id == "SR-CON-007")


def test_a_bias_is_told_with_its_size_and_within_its_interval():
    sets = filters(100, bias=0.04)
    biases = [bias_of(innovation_sets(one)[1].residual[:, 0]) for one in sets]
    (finding,) = [f for f in told(sets[1]) if f.id == "SR-CON-008"]

    # Of 4 cm the filter takes over what the range weighs in it.
    assert np.mean([b.mean for b in biases]) == pytest.approx(0.0385, abs=0.002)
    assert sum(b.low < 0.0385 < b.high for b in biases) >= 92
    assert (finding.severity, finding.unit) == ("warning", "m")
    assert "range measures 3.78 cm more range than predicted on average" in finding.message
    assert "0.37 of its sigma" in finding.message


def test_a_sure_but_slight_bias_is_only_told():
    (finding,) = [f for f in told(filters(1, n=4000, bias=0.015)[0]) if f.id == "SR-CON-008"]

    assert finding.severity == "info"
    assert finding.p_adjusted < 1e-3


def test_asking_each_axis_alone_is_paid_for():
    p = np.array([nis_tests(innovation_sets(one)[0]).p_value for one in filters(400)])

    assert np.mean(p < 0.05) < 0.065


def test_an_axis_that_is_wrong_alone_is_named():
    seen = filters(1)[0][0]
    (finding,) = told((replace(seen, residual=seen.residual * [1.5, 0.8]),), ["nis"])

    assert "the x innovations of position are 1.44" in finding.message
    assert "each axis alone: x 1.44, y 0.83" in finding.message


def test_a_slow_wave_is_no_bias():
    t_ns, S = np.arange(300), np.ones((300, 1, 1))
    wave = np.sin(np.arange(300) / 40.0)[:, None] + 0.3
    seen = Innovations("s", t_ns, wave, S, np.ones(300, dtype=bool))

    assert bias_of(wave[:, 0]).n_eff < 20.0
    assert innovation_bias.check(CheckContext(None, (), VIEW, "kf", (seen,))) == ()
    assert [f.id for f in told((seen,), ["innovation_bias", "whiteness"])] == ["SR-CON-007"]


# --- gates -----------------------------------------------------------------------------------


def test_outliers_that_the_gate_stops_do_not_accuse_r():
    sets = filters(20, outliers=0.03, gate=GATE)

    assert found(sets, "SR-CON-006") == 0
    ratios = [nis_tests(innovation_sets(one)[1]).joint.ratio for one in sets]
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.03)


def test_behind_a_gate_half_of_r_is_still_told_as_what_it_is():
    sets = filters(20, told_R=0.5, gate=GATE)

    assert found(sets, "SR-CON-006") == 20
    ratios = [nis_tests(innovation_sets(one)[1]).joint.ratio for one in sets]
    assert np.mean(ratios) == pytest.approx(np.sqrt(2.0), abs=0.04)
    naive = [mean_test(innovation_sets(s)[1].white[innovation_sets(s)[1].accepted]) for s in sets]
    assert np.mean([test.ratio for test in naive]) < 1.25  # what the gate would have hidden


def test_a_gate_that_rejects_too_many_is_told():
    one = filters(1, outliers=0.2, gate=GATE)[0]
    (finding,) = [f for f in told(one) if "rejected where a gate" in f.message]

    assert finding.severity == "warning"
    assert finding.value == pytest.approx(0.18, abs=0.03)
    assert finding.high < 0.02


def test_where_all_is_rejected_that_is_told():
    seen = filters(1, n=100)[0][1]
    none = replace(seen, residual=10.0 * np.sign(seen.residual), accepted=np.zeros(100, dtype=bool))
    few, rejected = sorted(told((none,)), key=lambda f: f.id)

    assert (few.id, rejected.id, rejected.severity) == ("SR-CON-003", "SR-CON-006", "error")
    assert "100 % of 100" in rejected.message


def test_without_a_gate_outliers_are_told_apart_from_a_small_r():
    (finding,) = [f for f in told(filters(1, outliers=0.05)[0]) if "range" in f.message]

    assert "outliers do it: the median innovation gives 1.0" in finding.message


def test_what_was_rejected_for_another_reason_only_hides_what_is_too_large():
    rng = np.random.default_rng(3)
    for scale, ids in ((1.5, ["SR-CON-006"]), (0.6, []), (1.0, [])):
        seen = filters(1)[0][1]
        other = replace(seen, residual=scale * seen.residual, accepted=rng.random(500) < 0.8)
        raised = told((other,), ["nis"])
        assert [f.id for f in raised] == ids
        assert all("by something else than their NIS" in f.message for f in raised)


@pytest.mark.parametrize(("dof", "cut"), [(1, 6.63), (2, 9.21), (3, 4.0), (2, np.inf)])
def test_moments_behind_a_gate_are_those_of_draws(dof, cut):
    w = np.random.default_rng(0).standard_normal((400_000, dof))
    w = w[np.sum(w**2, axis=1) <= cut]
    gate = Truncation(dof, cut)
    for k in range(1, dof + 1):
        squared = np.sum(w[:, :k] ** 2, axis=1)
        assert gate.mean(k) == pytest.approx(squared.mean(), rel=0.01)
        assert gate.variance(k) == pytest.approx(squared.var(), rel=0.03)


def test_the_moments_of_one_dimension_are_scipys():
    gate = Truncation(1, 4.0)
    mean, variance = truncnorm.stats(-2.0, 2.0, moments="mv")

    assert mean == 0.0
    assert gate.mean(1) == pytest.approx(variance)


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0, 5.0])
def test_the_scale_behind_a_gate_is_found_again(scale):
    gate = Truncation(2, 9.0)
    mean = scale**2 * Truncation(2, 9.0 / scale**2).mean(2)

    assert gate.scale(mean, 2) == pytest.approx(scale)
    assert gate.scale(4.5, 2) == SCALE_MAX  # evenly over the gate: any scale would do
    assert gate.scale(0.0, 2) == 0.0


@pytest.mark.parametrize("gate", [Truncation(1, 2.0), Truncation(2, 9.21)])
def test_the_mean_behind_a_gate_is_accused_as_seldom_as_it_should(gate):
    rng, p = np.random.default_rng(1), []
    for _ in range(1500):
        w = rng.standard_normal((60, gate.dof))
        p.append(mean_test(w[np.sum(w**2, axis=1) <= gate.cut], gate).p_value)

    assert np.mean(np.array(p) < 0.05) < 0.07
    assert np.mean(np.array(p) < 0.001) < 0.005


def test_the_gate_is_found_between_what_it_kept_and_what_it_did_not():
    rng, cuts = np.random.default_rng(2), []
    for _ in range(200):
        w = rng.standard_normal((300, 2))
        S, t_ns = np.tile(np.eye(2), (300, 1, 1)), np.arange(300)
        kept = np.sum(w**2, axis=1) <= 6.0
        (seen,) = innovation_sets([Innovations("s", t_ns, w, S, kept)])
        cuts.append(seen.gate.cut)
    (free,) = innovation_sets([Innovations("s", t_ns, w, S, np.ones(300, dtype=bool))])

    assert np.median(cuts) == pytest.approx(6.0, abs=0.3)
    assert free.gate.is_none


# --- the tests themselves --------------------------------------------------------------------


def test_whiteness_keeps_its_level_where_a_stretch_is_wild_and_ljung_box_does_not():
    rng, ours, theirs = np.random.default_rng(0), 0, 0
    size = np.where(np.arange(500) < 100, 3.0, 1.0)[:, None]
    for _ in range(300):
        x = rng.standard_normal((500, 1)) * size
        ours += whiteness(x).p_value < 0.05
        c = x[:, 0] - x.mean()
        rho = np.array([c[k:] @ c[: 500 - k] for k in range(1, 11)]) / (c @ c)
        q = 500 * 502 * np.sum(rho**2 / (500 - np.arange(1, 11)))
        theirs += chi2.sf(q, 10) < 0.05

    assert ours <= 30
    assert theirs >= 150


def test_whiteness_of_even_noise_is_ljung_boxs():
    x = np.random.default_rng(4).standard_normal((20_000, 1))
    c = x[:, 0] - x.mean()
    rho = np.array([c[k:] @ c[: len(c) - k] for k in range(1, 11)]) / (c @ c)
    q = len(c) * (len(c) + 2) * np.sum(rho**2 / (len(c) - np.arange(1, 11)))

    test = whiteness(x)

    np.testing.assert_allclose(test.rho[0], rho, atol=1e-12)
    np.testing.assert_allclose(test.error, len(c) ** -0.5, rtol=0.05)
    assert test.p_value == pytest.approx(chi2.sf(q, 10), abs=0.05)


def test_the_bias_of_independent_samples_is_students():
    x = np.random.default_rng(5).normal(0.02, 1.0, 400)
    ours, theirs = bias_of(x), ttest_1samp(x, 0.0)

    # But for the effective samples, of which a standard error is taken off.
    assert 200 < ours.n_eff <= 400
    wider = np.sqrt(400 / ours.n_eff)
    low, high = theirs.confidence_interval(0.95)
    assert ours.high - ours.low == pytest.approx(wider * (high - low), rel=0.01)
    assert ours.p_value == pytest.approx(2.0 * t.sf(abs(theirs.statistic) / wider, ours.n_eff - 1))
    assert ours.low < theirs.statistic * 0.05 < ours.high


def test_few_innovations_are_said_once_by_source_and_accuse_nobody():
    seen = filters(1, n=15, told_R=0.01)[0]
    findings = told(seen)

    assert [(f.id, f.severity) for f in findings] == [("SR-CON-003", "info")] * 2
    assert "too few innovations of position" in findings[0].message
    assert "15 accepted" in findings[1].message


def test_unsound_rows_are_left_out_and_counted_and_order_does_not_matter():
    seen = filters(1, told_R=0.5)[0][1]
    residual, S = seen.residual.copy(), seen.S.copy()
    residual[3], S[4], S[5] = np.nan, 0.0, -1.0
    damaged = replace(seen, residual=residual, S=S)
    mixed = np.random.default_rng(0).permutation(500)
    shuffled = Innovations(
        seen.source, seen.t_ns[mixed], residual[mixed], S[mixed], seen.accepted[mixed], seen.axes
    )
    (finding,) = told((damaged,), ["nis"])

    assert "3 without a sound covariance left out" in finding.message
    assert told((shuffled,)) == told((damaged,))


@pytest.mark.parametrize("n", [0, 1, 2, 19, 25])
def test_short_and_constant_innovations_make_no_traceback(n):
    t_ns, S = np.arange(n), np.tile(np.eye(2), (n, 1, 1))
    for residual in (np.zeros((n, 2)), np.ones((n, 2)), np.full((n, 2), np.nan)):
        for used in (True, False):
            seen = Innovations("s", t_ns, residual, S, np.full(n, used))
            assert all(f.message for f in told((seen,)))


def test_axes_without_names_are_numbered():
    seen = replace(filters(1, bias=0.04)[0][1], axes=())
    (finding,) = [f for f in told((seen,)) if f.id == "SR-CON-008"]

    assert "0.0371 more axis-1" in finding.message
    assert finding.unit == ""


# --- scans -----------------------------------------------------------------------------------


def quantiles(values):
    n = len(values)
    track = PoseTrack.without_covariance("map", "base", np.arange(n), np.zeros((n, 3)))
    diagnostics = {"likelihood_quantile": np.asarray(values, dtype=float)}
    context = CheckContext(track, (), VIEW, "amcl", diagnostics=diagnostics)
    return ask([context], ["scan_likelihood"])


def test_even_quantiles_are_left_alone_and_low_ones_are_not():
    rng = np.random.default_rng(0)
    even = [(rng.integers(0, 20, 300) + 0.5) / 20.0 for _ in range(200)]
    lost = [np.where(rng.random(300) < 0.2, 0.025, q) for q in even[:50]]
    partly = [np.where(np.arange(600) % 3 == 0, np.resize(q, 600), np.nan) for q in lost[:5]]

    assert sum(len(quantiles(q)) for q in even) <= 1
    assert all([f.severity for f in quantiles(q)] == ["warning"] for q in lost)
    assert all(quantiles(q)[0].n == 200 for q in partly)
    finding = quantiles([0.025] * 40 + [0.5] * 60)[0]
    assert (finding.id, finding.value, finding.high) == ("SR-CON-009", 0.4, 0.05)
    assert (finding.start_ns, finding.end_ns) == (0, 39)


def test_a_model_too_vague_to_be_surprised_is_said():
    (finding,) = quantiles([0.975] * 90 + [0.5] * 10)

    assert (finding.id, finding.severity) == ("SR-CON-003", "info")
    assert "90 % of scans are likelier" in finding.message
    assert "z_rand" in finding.message


def test_few_quantiles_decide_nothing_and_none_are_silent():
    (finding,) = quantiles([0.025] * 10)

    assert finding.id == "SR-CON-003"
    assert quantiles([np.nan] * 50) == []
    assert ask([CheckContext(None, (), VIEW, "amcl")], ["scan_likelihood"]) == []
