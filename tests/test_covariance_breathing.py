"""The corridor lab: closed forms, one least-squares problem, honest NEES, and the words."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from pydantic import ValidationError

from slamreplay.labs.covariance_breathing.corridor import Corridor, drive
from slamreplay.labs.covariance_breathing.lab import CovarianceBreathing

CORRIDOR = Corridor(
    steps=40, step_m=0.5, width_m=2.5, start_sigma_m=0.05, range_sigma_m=0.1, closure_sigma_m=0.05
)
START, RANGE, CLOSURE = 0.05**2, 0.1**2, 0.05**2
BOTH = ("side", "end")


def driven(every_steps=None, walls=(), told=0.1, true=None, runs=8, corridor=CORRIDOR, seed=3):
    share = np.array([1.0, 0.1])
    true = told if true is None else true
    rng = np.random.default_rng(seed)
    return drive(corridor, told * share, true * share, every_steps, walls, runs, rng)


def test_without_measurements_the_variance_is_the_sum_of_the_steps():
    P = driven(told=0.1).filtered.P

    k = np.arange(41)
    np.testing.assert_allclose(P[:, 0, 0], START + 0.1 * k)
    np.testing.assert_allclose(P[:, 1, 1], START + 0.01 * k)


def test_a_closure_makes_a_bridge_of_the_chain():
    """Random walk between two known ends: the middle stays widest, every pose tightens."""
    found = driven(told=0.1)

    k = np.arange(41)
    q = 0.1
    bridge = START + q * k - (q * k) ** 2 / (40 * q + CLOSURE)
    np.testing.assert_allclose(found.closed.P[:, 0, 0], bridge, rtol=1e-9)
    np.testing.assert_allclose(found.smoothed.P, found.filtered.P, rtol=1e-9)
    assert (found.closed.P[1:, 0, 0] < found.filtered.P[1:, 0, 0]).all()


def test_a_side_wall_tells_nothing_along_the_corridor():
    seen, blind = driven(1, ("side",)), driven()

    np.testing.assert_allclose(seen.filtered.P[:, 0, 0], blind.filtered.P[:, 0, 0])
    assert seen.filtered.P[-1, 1, 1] < 0.02 * blind.filtered.P[-1, 1, 1]


def test_a_range_every_step_settles_where_riccati_says():
    P = driven(1, BOTH, told=0.1).filtered.P

    for axis, q in enumerate((0.1, 0.01)):
        prior = (q + np.sqrt(q * q + 4.0 * q * RANGE)) / 2.0  # p = p r / (p + r) + q
        assert P[-1, axis, axis] == pytest.approx(prior * RANGE / (prior + RANGE), rel=1e-9)


@pytest.mark.parametrize(
    ("every_steps", "walls"), [(None, ()), (8, BOTH), (1, BOTH), (3, ("side",))]
)
def test_the_closed_chain_is_one_least_squares_problem(every_steps, walls):
    K = CORRIDOR.steps + 1
    P = driven(every_steps, walls).closed.P

    for axis, (q, wall) in enumerate(((0.1, "end"), (0.01, "side"))):
        eye = np.eye(K)
        information = np.outer(eye[0], eye[0]) / START
        for k in range(1, K):
            step = eye[k] - eye[k - 1]
            information += np.outer(step, step) / q
            if every_steps and k % every_steps == 0 and wall in walls:
                information += np.outer(eye[k], eye[k]) / RANGE
        closure = eye[-1] - eye[0]
        information += np.outer(closure, closure) / CLOSURE
        np.testing.assert_allclose(P[:, axis, axis], np.diag(np.linalg.inv(information)), rtol=1e-8)


@pytest.mark.parametrize(("every_steps", "walls"), [(None, ()), (8, BOTH), (1, ("side",))])
def test_true_error_is_as_large_as_claimed_where_the_noise_is_told(every_steps, walls):
    found = driven(every_steps, walls, runs=4000)

    for chain in (found.filtered, found.smoothed, found.closed):
        mean = chain.nees().mean(axis=1)
        # A mean of 4000 chi-square values of two degrees of freedom: sigma 2 / sqrt(4000).
        assert np.abs(mean - 2.0).max() < 5.0 * 2.0 / np.sqrt(4000)
    assert abs(found.closure_nis.mean() - 2.0) < 5.0 * 2.0 / np.sqrt(4000)


def test_a_noise_told_too_small_keeps_sigma_tiny_while_the_error_grows():
    found = driven(told=1e-4, true=0.1, runs=2000)

    sigma = np.sqrt(found.filtered.P[:, 0, 0])
    rms = np.sqrt(np.mean(found.filtered.error[:, :, 0] ** 2, axis=1))
    assert sigma[-1] < 0.1
    np.testing.assert_allclose(rms[-1], np.sqrt(START + 40 * 0.1), rtol=0.1)
    assert rms[-1] > 1.3 * rms[20] > 1.6 * rms[8]
    assert found.closure_nis.mean() > 100.0  # where an independent measurement says so


def recipe_parameters(**changes):
    folder = Path(__file__).resolve().parents[1] / "recipes" / "covariance-breathing"
    return yaml.safe_load((folder / "recipe.yaml").read_text())["parameters"] | changes


def test_words_follow_the_rules():
    answer = CovarianceBreathing.model_validate(recipe_parameters(runs=200)).run(5).numbers

    said = {}
    for case in answer["cases"]:
        words = tuple(case[key] for key in ("along", "across", "closure"))
        said.setdefault(case["updates"], set()).add(words)
        assert case["growth_along"] >= 1.3 or case["along"] == "stays bounded"
        assert case["belief"] == "consistent"
    grows, bounded = "grows without bound", "stays bounded"
    assert said == {
        "never": {(grows, grows, "snaps tight")},
        "every 8th step, side and end wall": {(bounded, bounded, "changes little")},
        "every step, side and end wall": {(bounded, bounded, "changes little")},
        "every step, side wall": {(grows, bounded, "snaps tight")},
    }
    assert {case["belief"] for case in answer["collapse"]} == {"collapsed"}


def test_another_seed_is_another_sample_of_the_same_sigmas():
    lab = CovarianceBreathing.model_validate(recipe_parameters(runs=20))
    one, two = lab.run(1).numbers["cases"][0], lab.run(2).numbers["cases"][0]

    assert one["error_along_before_m"] != two["error_along_before_m"]
    assert one["sigma_along_before_m"] == two["sigma_along_before_m"]
    assert lab.run(1).numbers["cases"][0] == one


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"step_m": 0.3}, "whole number of step_m"),
        ({"corridor_m": 1.0}, "whole number of step_m"),
        ({"runs": 90_000}, "steps times runs"),
        ({"process_noise_m2_per_step": [0.01, -0.1]}, "greater than or equal to"),
        ({"process_noise_m2_per_step": [float("nan")]}, "finite"),
        ({"process_noise_m2_per_step": [0.1, 0.1]}, "twice"),
        ({"process_noise_m2_per_step": [0.5]}, "should be one of process_noise"),
        ({"updates": [{"every_steps": 11, "walls": ["side"]}]}, "a quarter of the steps"),
        ({"updates": [{"every_steps": 4, "walls": []}]}, "walls should be named"),
        ({"updates": [{"every_steps": 4, "walls": ["side", "side"]}]}, "names one twice"),
        ({"updates": [{"every_steps": None, "walls": []}] * 2}, "names one twice"),
        ({"runs": True}, "valid integer"),
        ({"runs": 100.5}, "valid integer"),
        ({"range_sigma_m": "0.1"}, "valid number"),
    ],
)
def test_a_corridor_that_makes_no_sense_is_refused(changes, said):
    with pytest.raises(ValidationError, match=said):
        CovarianceBreathing.model_validate(recipe_parameters(**changes))


def test_the_collapse_must_be_one():
    wrong = {"told_process_noise_m2_per_step": 0.1, "true_process_noise_m2_per_step": 0.1}

    with pytest.raises(ValidationError, match="smaller than the true one"):
        CovarianceBreathing.model_validate(recipe_parameters(collapse=wrong))
