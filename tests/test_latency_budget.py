"""What a stage, a loop that waits for it and the gate make of the age of poses; and the recipe."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slamreplay.bundle.belief import belief_times, recorded_belief
from slamreplay.cli.perturb import perturb
from slamreplay.errors import UsageError
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S, ns
from slamreplay.labs.latency_budget.ask import Gate, Replayed, Stage
from slamreplay.labs.latency_budget.gate import gate_at, gate_curve
from slamreplay.labs.latency_budget.replayed import checked
from slamreplay.recipes import BudgetRecipe, read_recipe
from slamreplay.testing.synthetic import START_NS, synthetic_bundle, true_path
from slamreplay.verdict.latency.consumers import Consumer, moving_times
from slamreplay.verdict.latency.gated import Rooms, rooms
from slamreplay.verdict.latency.latency import latency
from slamreplay.verdict.latency.stages import Reach, behind, blocked, towards
from slamreplay.verdict.limits import Limits

ROOT = Path(__file__).resolve().parents[1]
RECIPE = ROOT / "recipes" / "latency-budget" / "recipe.yaml"
TEXT = RECIPE.read_text(encoding="utf-8")
NO_LEVER = Reach(lever_m=0.0, odometry_error=0.0)


@pytest.fixture(scope="module")
def room():
    """A robot that drives round a room at 0.5 m/s, and a controller at 50 Hz."""
    bundle = synthetic_bundle(seconds=30.0)
    found = latency(bundle.view())
    return bundle, found, Consumer("controller", None, moving_times(found.track, 50.0), 50.0)


# --- stages ----------------------------------------------------------------------------------


@pytest.mark.parametrize("stage_s", [0.0, 0.08, 0.3])
def test_what_is_unknown_is_speed_times_age(room, stage_s):
    _, found, user = room
    lag = behind(found, user, ns(stage_s))
    known = np.isfinite(lag.ages.correction_s)
    # Corrections come every 0.5 s, 5 ms after their scan: no stage here makes them fewer.
    after = lag.ages.correction_s[known]

    assert after.min() >= 0.005 + stage_s - 1e-9
    assert after.max() <= 0.505 + stage_s + 1e-9
    np.testing.assert_allclose(lag.held_m(NO_LEVER)[known], 0.5 * after, rtol=0.1, atol=0.01)
    # tf reaches 0.1 s beyond the scan: the rest of the correction's age nobody carries.
    reach = np.maximum(after - 0.1, lag.ages.odometry_s[known])
    np.testing.assert_allclose(lag.ages.pose_s[known], reach, atol=1e-9)
    assert (lag.carried_m(NO_LEVER) <= lag.held_m(NO_LEVER) + 0.05)[known].all()


def test_a_lever_and_wrong_odometry_add_to_it(room):
    _, found, user = room
    lag = behind(found, user, ns(0.15))
    known = np.isfinite(lag.ages.correction_s)
    far, wrong = Reach(2.0, 0.0), Reach(0.0, 0.1)

    np.testing.assert_allclose(
        (lag.held_m(far) - lag.held_m(NO_LEVER))[known], 2.0 * np.abs(lag.held[known, 2])
    )
    np.testing.assert_allclose(
        (lag.carried_m(wrong) - lag.carried_m(NO_LEVER))[known], 0.1 * lag.held_m(NO_LEVER)[known]
    )


def test_motion_is_told_in_the_frame_in_which_it_is_used(room):
    """Who turned by a quarter while driving an arc came from behind and from the side."""
    _, found, _ = room
    at = START_NS + ns(20.0)
    lag = behind(found, Consumer("controller", None, np.array([at]), 50.0), ns(4.0))
    back, now = true_path((np.array([lag.ages.measured_ns[0], at]) - START_NS) / NS_PER_S)
    moved = se2.transform_points(np.array([0.0, 0.0, -now[2]]), (now - back)[None, :2])[0]

    np.testing.assert_allclose(lag.held[0, :2], moved, atol=0.15)


@settings(max_examples=80, deadline=None)
@given(st.floats(-3.1, 3.1), st.floats(0.0, 1.0), st.floats(-0.5, 0.5), st.floats(0.0, 2.0))
def test_towards_is_never_more_than_the_whole(angle, way, turn, lever):
    u = np.array([np.cos(angle), np.sin(angle)])
    motion = np.array([[way, 0.0, turn]])
    one = towards(motion, u, lever)[0]

    assert one <= way + abs(turn) * lever + 1e-9
    assert towards(motion, np.array([1.0, 0.0]), lever)[0] == pytest.approx(way)
    assert towards(motion, np.array([0.0, 1.0]), lever)[0] == pytest.approx(abs(turn) * lever)


def test_a_query_of_80_ms_and_loops_that_wait_for_it():
    planner, busy, controller = blocked(10.0, 0.08), blocked(10.0, 0.08, 0.063), blocked(50.0, 0.08)

    assert (planner.missed, planner.late_s, planner.rate_hz) == (0, 0.0, 10.0)
    assert planner.share == pytest.approx(0.8)
    assert (busy.missed, busy.late_s) == (1, pytest.approx(0.043))
    assert busy.rate_hz == pytest.approx(1 / 0.143)
    assert (controller.missed, controller.late_s) == (3, pytest.approx(0.06))
    assert controller.rate_hz == pytest.approx(12.5)
    assert blocked(50.0, 0.02).missed == 0  # just a cycle


# --- the gate --------------------------------------------------------------------------------


def by_hand(sigma, clearance, direction, every_s=1.0):
    n = len(sigma)
    t = START_NS + ns(3.0) + np.arange(n) * ns(every_s)
    begins = np.zeros(n, dtype=bool)
    return Rooms(t, t + ns(every_s), begins, np.array(sigma), np.array(clearance),
                 np.array(direction, dtype=float), 0)  # fmt: skip


def test_without_room_nothing_is_allowed_however_sure_the_robot_is():
    made = by_hand([0.0, 0.0], [0.0, 0.01], [[1.0, 0.0], [1.0, 0.0]])

    assert made.allowed(0.0, 3.0).tolist() == [False, True]


def test_the_gate_adds_the_lag_towards_the_obstacle(room):
    _, found, user = room
    # Straight ahead, and to the side; 3 sigma is 24 cm of 30 cm.
    made = by_hand([0.08, 0.08], [0.30, 0.30], [[1.0, 0.0], [0.0, 1.0]])
    lag = behind(found, user, ns(0.1))
    held, carried = made.lags(lag, NO_LEVER)
    rows = (user.t_ns >= made.t_ns[0]) & (user.t_ns < made.until_ns[0])

    assert made.allowed(0.0, 3.0).all()
    assert held[0] == pytest.approx(np.nanmax(np.abs(lag.held[rows, 0])))
    assert held[0] == pytest.approx(0.5 * 0.6, rel=0.1)  # the oldest correction in that second
    assert made.allowed(held, 3.0).tolist() == [False, True]
    assert (carried <= held + 1e-9).all()
    assert not made.allowed(np.array([0.061, 0.061]), 3.0).any()
    assert made.allowed(np.array([0.059, 0.059]), 3.0).all()


def test_nobody_who_used_a_pose_is_late_by_it(room):
    _, found, user = room
    never = replace(user, t_ns=np.zeros(0, dtype=np.int64))

    assert [lag.tolist() for lag in by_hand([0.1], [1.0], [[1, 0]]).lags(
        behind(found, never, 0), NO_LEVER)] == [[0.0], [0.0]]  # fmt: skip


def test_the_critical_stage_is_where_the_shares_cross(room):
    _, found, user = room
    made = by_hand(np.full(20, 0.08), np.full(20, 0.6), np.tile([1.0, 0.0], (20, 1)))
    curve = gate_curve(found, user, made, Gate(still_allowed_ratio=0.9, longest_stage_s=1.5),
                       NO_LEVER)  # fmt: skip
    # 36 cm are left for a lag that is 0.5 m/s times (stage + up to 0.505 s) at its most.
    expected = 0.36 / 0.5 - 0.505

    assert curve.critical_s["held"] == pytest.approx(expected, abs=0.06)
    assert curve.critical_s["carried"] == pytest.approx(expected + 0.1, abs=0.06)
    assert curve.held[0] == 1.0
    assert curve.held[-1] == 0.0
    before = gate_at(curve, found, curve.critical_s["held"] - 0.1, NO_LEVER)["held"]
    behind_it = gate_at(curve, found, curve.critical_s["held"] + 0.1, NO_LEVER)["held"]
    assert (before.blocked, before.first) == (0, None)
    assert behind_it.blocked > 10
    wide = by_hand([0.08], [9.0], [[1.0, 0.0]])
    ask = Gate(still_allowed_ratio=0.9, longest_stage_s=1.0)
    assert gate_curve(found, user, wide, ask, NO_LEVER).critical_s == {
        "held": None, "carried": None
    }  # fmt: skip


def test_rooms_of_a_log_are_those_of_the_gate(room):
    bundle, _, user = room
    view = bundle.view()
    made = rooms(view, recorded_belief(view, belief_times(view)), Limits(), user.t_ns)

    assert 25 <= len(made) <= 32
    np.testing.assert_allclose(made.sigma_m, np.sqrt(1e-3), rtol=1e-3)
    np.testing.assert_allclose(np.hypot(*made.direction_xy.T), 1.0, atol=1e-9)
    assert (made.clearance_m < 3.0).all()
    assert rooms(view, None, Limits(), user.t_ns) is None


# --- against replay --------------------------------------------------------------------------


def test_the_formula_is_what_a_replay_with_that_delay_shows():
    bundle = synthetic_bundle(seconds=8.0)
    asked = [Replayed(estimator="scan_matching", perturbation="scan_delay.stamp")]
    (scans,) = checked(bundle, asked, [Stage(name="x", stage_s=0.1)], seed=0)

    assert scans.n > 60
    assert scans.predicted_m[0] == pytest.approx(0.05, rel=0.1)
    # It begins while the robot moves: what it is off by turns with it.
    assert scans.replayed_m[0] < 2.0 * scans.predicted_m[1]


# --- the recipe ------------------------------------------------------------------------------

HOSTILE = {
    "budget": (TEXT.replace("controller_hz:", "controler_hz:"), "mean 'controller_hz'?"),
    "beside": (TEXT.replace("scenario:", "scenari:"), "mean 'scenario'?"),
    "scenario": (TEXT.replace("{name: healthy", "{name: helthy"), "no scenario 'helthy'"),
    "no seed": (TEXT.replace("seed: 1\n", ""), "the key 'seed' is missing"),
    "stage": (TEXT.replace("stage_s: 0.08", "stage_s: -0.08"), "stages.0.stage_s' is -0.08"),
    "ms": (TEXT.replace("stage_s: 0.08", "stage_ms: 80"), "mean 'stage_s'?"),
    "stages": (TEXT.replace("  stages:\n", "  stages: []\n  more:\n"), "no key 'budget.more'"),
    "text": (TEXT.replace("50.0", "'50'"), "controller_hz' is '50'"),
    "estimator": (TEXT.replace("estimator: amcl", "estimator: amcel"), "mean 'amcl'?"),
    "perturbation": (TEXT.replace("scan_delay.stamp", "scan_dely.stamp"), "no perturbation"),
    "variant": (TEXT.replace("scan_delay.stamp", "scan_delay.x"), "one of scan_delay.stamp"),
    "no delay": (TEXT.replace("scan_delay.stamp", "odometry_scale.distance"), "perturbation' is"),
    "ratio": (TEXT.replace("still_allowed_ratio: 0.9", "still_allowed_ratio: 90"), "is 90"),
    "question": (TEXT.replace("question: Does", "question: ''  # "), "'question' is ''"),
    "two lines": (TEXT.replace("name: place recognition", 'name: "a\\nb"'), "one line of text"),
    "cells": (TEXT.replace("name: place recognition", 'name: "a | b"'), "one line of text"),
    "nan": (TEXT.replace("lever_m: 1.0", "lever_m: .nan"), "'budget.lever_m' is nan"),
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_a_budget_that_is_none_gets_one_clear_line(name, tmp_path):
    text, said = HOSTILE[name]
    assert text != TEXT
    path = tmp_path / "recipe.yaml"
    path.write_text(text, encoding="utf-8")

    with pytest.raises(UsageError) as caught:
        read_recipe(path)

    line = str(caught.value)
    assert said in line, line
    assert "\n" not in line
    assert len(line) < len(str(path)) + 400


def test_the_shipped_recipe_is_a_budget():
    recipe = read_recipe(RECIPE)

    assert isinstance(recipe, BudgetRecipe)
    assert [s.stage_s for s in recipe.parameters.stages] == [0.08, 0.15, 0.3]
    assert (recipe.parameters.controller_hz, recipe.parameters.planner_hz) == (50.0, 10.0)


def test_a_log_takes_the_scenarios_place_and_the_same_gives_the_same_bytes(tmp_path, capsys):
    small = TEXT[: TEXT.index("  replayed:")] + "  replayed: []\n"
    (tmp_path / "r.yaml").write_text(small, encoding="utf-8")
    log = ROOT / "sample_logs" / "healthy_short.bag"
    for out in ("a", "b"):
        perturb(tmp_path / out, [log], recipe=tmp_path / "r.yaml", as_json=True)
    said = capsys.readouterr().out

    assert said[: len(said) // 2] == said[len(said) // 2 :]
    told = json.loads(said[: len(said) // 2])
    assert (told["log"], told["scenario"]) == (["healthy_short.bag"], None)
    assert [(c["name"], c["topic"]) for c in told["results"]["consumers"]] == [
        ("controller", "/cmd_vel"), ("planner", "/plan"), ("goals", "/behavior_tree_log"),
        ("controller", None), ("planner", None),
    ]  # fmt: skip
    names = sorted(p.name for p in (tmp_path / "a").iterdir())
    assert names == ["latency_budget.png", "latency_budget.svg", "results.json", "results.md"]
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name


def test_what_a_budget_cannot_take_is_said(tmp_path):
    (tmp_path / "r.yaml").write_text(
        TEXT.replace("scenario: {name: healthy, seed: 1}\n", ""), encoding="utf-8"
    )

    with pytest.raises(UsageError, match="there is no LOG to replay"):
        perturb(tmp_path / "o", recipe=tmp_path / "r.yaml")
    with pytest.raises(UsageError, match="a budget takes no --perturbation"):
        perturb(tmp_path / "o", recipe=RECIPE, perturbations=["tf_delay=1"])
    with pytest.raises(UsageError, match="simulated log takes no --map"):
        perturb(tmp_path / "o", recipe=RECIPE, start_s=3.0)
    assert not (tmp_path / "o").exists()
