"""Recipes of gates: what they demand of which log, and one clear line for each mistake."""

from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slamreplay.errors import UsageError
from slamreplay.gate.rules import BaselineRules, Limit, Rules
from slamreplay.recipes import GateRecipe, read_recipe

GATE = """\
version: 1
question: Does every log still fare as it must?
expect: [state=healthy]
forbid: [SR-LOC-*, failure_mode=kidnapped]
max_severity: warning
limits:
  error_max_m: 0.5
  error_m: {max: 0.3, clear: 0.2, for_s: 2}
  hindsight_coverage: {min: 0.9}
estimators: [amcl]
seeds: 2
baseline: {alpha: 0.01, margins: {error_mean_m: 0.05, amcl.error_max_m: 0.1}}
logs:
  lost*:
    expect: [state=lost, SR-CON-010]
    forbid: []
    limits: {error_max_m: null, amcl.error_max_m: 1, error_m: {max: 9.0}}
  "site_b/*.mcap": {max_severity: error, require_assessable: false}
"""


def read(text, folder):
    path = Path(folder) / "gate.yaml"
    path.write_text(text, encoding="utf-8")
    return read_recipe(path)


def test_the_keys_at_the_top_hold_for_every_log(tmp_path):
    recipe = read(GATE, tmp_path)

    assert isinstance(recipe, GateRecipe)
    demands = recipe.demands
    assert (demands.question, demands.estimators, demands.seeds) == (
        "Does every log still fare as it must?",
        ("amcl",),
        2,
    )
    assert demands.baseline == BaselineRules(0.01, {"error_mean_m": 0.05, "amcl.error_max_m": 0.1})
    assert demands.rules_of("logs/healthy.mcap") == Rules(
        ("state=healthy",),
        ("SR-LOC-*", "failure_mode=kidnapped"),
        "warning",
        (
            Limit("error_max_m", 0.5),
            Limit("error_m", 0.3, None, 0.2, 2.0),
            Limit("hindsight_coverage", None, 0.9),
        ),
    )


def test_a_pattern_lays_its_rules_over_those_of_the_top(tmp_path):
    demands = read(GATE, tmp_path).demands
    lost = demands.rules_of("a/b/lost_robot.mcap")

    assert (lost.expect, lost.forbid, lost.max_severity) == (
        ("state=lost", "SR-CON-010"),
        (),
        "warning",
    )
    assert lost.limits == (
        Limit("hindsight_coverage", None, 0.9),
        Limit("amcl.error_max_m", 1.0),
        Limit("error_m", 9.0),
    )
    there = demands.rules_of("/data/site_b/x.mcap")
    assert (there.max_severity, there.require_assessable) == (None, False)
    assert there.expect == ("state=healthy",)
    assert demands.rules_of("/data/site_b/deeper/x.mcap") == demands.rules
    # The first pattern that fits counts.
    assert demands.rules_of("site_b/lost.mcap") == lost


def test_a_metric_may_have_several_limits_in_a_list(tmp_path):
    text = GATE.partition("limits:")[0] + (
        "limits: [{metric: error_m, max: 0.3, for_s: 5}, {metric: error_m, max: 2}]\n"
    )

    assert read(text, tmp_path).demands.rules.limits == (
        Limit("error_m", 0.3, None, None, 5.0),
        Limit("error_m", 2.0),
    )


@pytest.mark.parametrize(
    "key",
    [
        "expect: [SR-MAP-001]",
        "forbid: ['SR-*']",
        "max_severity: info",
        "limits: {stops: 0}",
        "logs: {a*: {expect: [state=lost]}}",
    ],
)
def test_any_demand_makes_it_a_gate(key, tmp_path):
    assert isinstance(read(f"version: 1\nquestion: Is it so?\n{key}\n", tmp_path), GateRecipe)


def limits(text):
    return GATE.replace("error_max_m: 0.5", text)


MISTAKES = {
    "finding": (GATE.replace("SR-CON-010", "SR-CON-01"), "did you mean 'SR-CON-0"),
    "lower case": (GATE.replace("SR-CON-010", "sr-con-010"), "did you mean 'SR-CON-010'?"),
    "far off": (GATE.replace("SR-CON-010", "lost"), "'slamreplay list findings' has them all"),
    "pattern": (GATE.replace("SR-LOC-*", "SR-LOK-*"), "there is no finding 'SR-LOK-*'"),
    "state": (GATE.replace("state=healthy", "state=helthy"), "did you mean 'healthy'?"),
    "mode": (GATE.replace("=kidnapped", "=kidnaped"), "no failure mode 'kidnaped'"),
    "kind": (GATE.replace("state=healthy", "stat=healthy"), "did you mean 'state'?"),
    "two states": (GATE.replace("state=healthy", "state=healthy, state=lost"), "one state, not"),
    "both": (GATE.replace("[SR-LOC-*,", "[state=healthy,"), "state=healthy is expected and forb"),
    "in a pattern": (GATE.replace("forbid: []", "forbid: [SR-CON-010]"), "'logs.lost*.forbid'"),
    "twice": (GATE.replace("[SR-LOC-*,", "[SR-LOC-*, SR-LOC-*,"), "stands there twice"),
    "severity": (GATE.replace("severity: warning", "severity: fatal"), "'fatal' is no severity"),
    "none": (GATE.replace("severity: warning", "severity: none"), "forbid: ['SR-*']"),
    "metric": (limits("eror_max_m: 1"), "did you mean 'error_max_m'?"),
    "no estimator": (limits("ekf.error_max_m: 1"), "'estimators' names amcl"),
    "of estimators": (limits("amcl.error_max: 1"), "did you mean 'error_max_m'?"),
    "empty": (limits("error_max_m: {}"), "neither max nor min"),
    "null": (limits("error_max_m:"), "error_max_m has no value"),
    "text": (limits("error_max_m: much"), "'limits.error_max_m.max' is 'much'"),
    "truth": (limits("error_max_m: true"), "'limits.error_max_m.max' is True"),
    "nan": (limits("error_max_m: .nan"), "'limits.error_max_m.max' is nan"),
    "key of it": (limits("error_max_m: {maximum: 1}"), "no key 'limits.error_max_m.maximum'"),
    "clear above": (limits("error_max_m: {max: 1, clear: 2}"), "clear 2 is above max 1"),
    "clear below": (limits("confidence: {min: 0.9, clear: 0.8}"), "clear 0.8 is below min"),
    "clear of both": (limits("nees_factor: {max: 2, min: 0.5, clear: 1}"), "not of both"),
    "no room": (limits("nees_factor: {max: 0.5, min: 2}"), "min 2 is above max 0.5"),
    "for_s": (limits("error_max_m: {max: 1, for_s: 2}"), "numbers over time are error_m"),
    "negative": (GATE.replace("for_s: 2", "for_s: -2"), "'limits.error_m.for_s' is -2"),
    "list": (GATE.partition("limits:")[0] + "limits: [3]\n", "'limits.0': it has no metric"),
    "number": (GATE.partition("limits:")[0] + "limits: 3\n", "no list and no lines of METRIC"),
    "estimator": (GATE.replace("[amcl]", "[amlc]"), "did you mean 'amcl'?"),
    "recorded": (GATE.replace("[amcl]", "[amcl, recorded]"), "judged without being run again"),
    "seeds": (GATE.replace("seeds: 2", "seeds: 0"), "'seeds' is 0"),
    "empty pattern": (GATE.replace("lost*:", "'':"), "is no pattern"),
    "long pattern": (GATE.replace("lost*:", f"{'a*' * 200}:"), "is no pattern"),
    "escape": (GATE.replace("lost*:", '"\\e[31m":'), "is no pattern"),
    "windows": (GATE.replace("lost*:", "'logs\\lost*':"), "forward slashes"),
    "rules": (GATE.replace("logs:\n  lost*:\n", "logs:\n  a*: 3\n  lost*:\n"), "'logs.a*'"),
    "key": (GATE.replace("max_severity: w", "max_severty: w"), "did you mean 'max_severity'?"),
    "inner key": (GATE.replace("    forbid:", "    forbit:"), "did you mean 'forbid'?"),
    "alpha": (GATE.replace("alpha: 0.01", "alpha: 5"), "'baseline.alpha' is 5"),
    "margin": (GATE.replace("error_mean_m:", "error_men_m:"), "did you mean 'error_mean_m'?"),
    "odd key": (GATE.replace("error_mean_m: 0.05", '"\\e[31m": x'), "margins.\\x1b[31m' is 'x'"),
    "less": (GATE.replace("error_mean_m: 0", "error_mean_m: -1"), "greater than or equal to 0"),
    "nothing": ("version: 1\nquestion: Is it?\nmax_severity: error\n", "it demands nothing"),
    "no question": (GATE.replace("question:", "# "), "the key 'question' is missing"),
    "lines": (GATE.replace("Does every", '"Does\\nevery').replace("must?", 'must?"'), "one line"),
    "design": (GATE + "perturbations: []\n", "there is no key 'expect'"),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_gets_one_clear_line(name, tmp_path):
    text, said = MISTAKES[name]

    with pytest.raises(UsageError) as caught:
        read(text, tmp_path)

    line = str(caught.value)
    assert line.startswith(str(tmp_path / "gate.yaml"))
    assert said in line
    assert line.isprintable()
    assert len(line) < len(str(tmp_path)) + 400


def test_a_margin_of_nothing_known_does_not_list_everything(tmp_path):
    with pytest.raises(UsageError, match="follows baseline/") as caught:
        read(GATE.replace("amcl.error_max_m: 0.1", "ax_m: 0.1"), tmp_path)
    assert len(str(caught.value)) < len(str(tmp_path)) + 200


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.integers(0, len(GATE)),
            st.integers(0, 12),
            st.sampled_from(
                ["", " ", "\n", "-", "0", "1e400", "{", "[", "]", "}", ": ", "'", '"', "*", "?",
                 "null", "~", ".nan", "state=", "\\", "true", "\u202e", "[!", "."]
            ),
        ),
        min_size=1,
        max_size=4,
    )
)  # fmt: skip
def test_a_damaged_gate_is_read_or_refused_in_one_line(edits):
    text = GATE
    for at, length, put in edits:
        text = text[:at] + put + text[at + length :]
    with TemporaryDirectory() as folder:
        said = ""
        try:
            recipe = read(text, folder)
        except UsageError as error:
            said = str(error)
        else:
            recipe.demands.rules_of("logs/healthy.mcap")
        assert said.isprintable()
        assert len(said) < len(folder) + 500
