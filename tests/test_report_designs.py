"""What a report says of trials: what was changed, how much it took, what broke first."""

from dataclasses import replace

import numpy as np
import pytest

from slamreplay.bundle.run import Estimate, Run, Trial
from slamreplay.bundle.track import PoseTrack
from slamreplay.evidence.result import TrialResult
from slamreplay.postmortem import postmortem
from slamreplay.replay.dose import Control
from slamreplay.report.build import build
from slamreplay.report.designs import design_notes, design_of, design_table, ranking_table
from slamreplay.report.html import html
from slamreplay.report.phrases import trials_note
from slamreplay.report.trace_text import jump_lines
from slamreplay.report.trial_curves import curves_of_trials
from slamreplay.testing.synthetic import START_NS, synthetic_bundle


@pytest.fixture(scope="module")
def bare():
    return postmortem(synthetic_bundle(seconds=6.0))


def trial(perturbation, level, unit, error_m, estimator="amcl"):
    cov = np.eye(3)[None]
    track = PoseTrack("map", "base_link", np.array([START_NS]), np.zeros((1, 3)), cov)
    of = Trial("b", estimator, 0, perturbation, level, unit)
    estimate = None if error_m is None else Estimate(track)
    return TrialResult(Run(of, estimate, "no such setting"), {"reference_max_m": error_m})


def with_trials(post, *more):
    return replace(post, trials=(trial(None, None, "", 0.1), *more))


def test_levels_become_a_curve_with_the_level_at_which_it_broke(bare):
    doses = [(0.4, 0.9), (0.1, 0.2), (0.2, 0.45)]
    post = with_trials(bare, *(trial("tf_delay.odometry", *d[:1], "s", d[1]) for d in doses))

    [curve] = curves_of_trials(post).curves

    assert [r.level for r in curve.responses] == [0.0, 0.1, 0.2, 0.4]
    [critical] = curve.critical
    assert (critical.level, critical.low, critical.outcome) == (0.4, 0.2, "crossed")
    assert curve.responses[3].paired["reference_max_m"].mean == pytest.approx(0.8)
    assert curve.broke_first == "reference_max_m"
    assert "had no controls" in design_notes(design_of(post))[-1]


def test_both_sides_of_a_baseline_are_two_curves_and_refusals_say_why(bare):
    post = with_trials(
        bare,
        trial("odometry_scale.rotation", 0.8, "ratio", 0.7),
        trial("odometry_scale.rotation", 1.2, "ratio", 0.3),
        trial("min_score.scale", 0.5, "ratio", None),
    )

    below, above, refused = curves_of_trials(post).curves

    assert (below.critical[0].level, above.critical[0].outcome) == (0.8, "never")
    assert refused.reason == "no such setting"
    rows = design_table(design_of(post)).rows
    assert [row[0].text for row in rows] == [
        "odometry_scale.rotation below 1", "odometry_scale.rotation above 1", "min_score.scale",
    ]  # fmt: skip
    assert [row[4].text for row in rows] == ["0.8 ratio", "held up to 1.2", ""]
    assert [row[1].text for row in ranking_table(design_of(post)).rows] == [
        "odometry_scale.rotation"
    ] * 2


def test_no_dose_is_blamed_for_what_is_broken_undisturbed(bare):
    post = replace(
        bare, trials=(trial(None, None, "", 0.8), trial("tf_delay.odometry", 0.2, "s", 0.9))
    )

    [curve] = curves_of_trials(post).curves

    assert (curve.critical[0].outcome, curve.broke_first) == ("always", None)
    assert [row[5].text for row in design_table(design_of(post)).rows] == ["nothing more"]


def test_without_perturbations_there_is_no_design(bare):
    assert curves_of_trials(with_trials(bare)) is None
    assert build(with_trials(bare)).design is None
    assert "how much it took" not in html(with_trials(bare))


def test_a_failed_control_of_a_recipe_is_the_first_thing_said(bare):
    post = with_trials(bare, trial("tf_delay.odometry", 0.2, "s", 0.9))
    failed = Control(
        "positive", "amcl", "initial_pose.offset", 20.0, "m", passed=False, text="crosses nothing"
    )
    post = replace(post, design=replace(curves_of_trials(post), controls=(failed,)))

    page, part = html(post), build(post).design

    assert design_notes(post.design)[0].startswith("POSITIVE CONTROL FAILED")
    assert "POSITIVE CONTROL FAILED" in page
    assert part.controls[0].passed is False
    assert part.curves[0].critical[0].level == 0.2


def test_a_note_begins_with_a_capital_unless_it_begins_with_a_name(bare):
    design = curves_of_trials(with_trials(bare, trial("tf_delay.odometry", 0.2, "s", 0.9)))
    noted = replace(design, curves=(replace(design.curves[0], notes=("see there",)),))

    said = design_notes(noted)

    assert "tf_delay.odometry with amcl: see there." in said
    assert all(note[0].isupper() for note in said if "see there" not in note)


@pytest.mark.parametrize(
    ("metric", "says"),
    [
        ("reference_rmse_m", "own reference, nothing aligned"),
        ("hindsight_rmse_m", "to hindsight"),
        ("ate_aligned_m", "laid onto it"),
        ("baseline_max_m", "Nothing judges"),
        ("relations_m", "no frame in common"),
    ],
)
def test_trials_say_what_their_errors_are_held_against(bare, metric, says):
    one = replace(trial("tf_delay.odometry", 0.2, "s", None), metrics={metric: 0.1})

    assert says in trials_note(replace(bare, trials=(one,)))


def test_a_perturbation_that_is_not_installed_here_is_left_to_the_table_of_trials(bare):
    assert curves_of_trials(with_trials(bare, trial("of_a_plug_in.much", 0.5, "m", 0.9))) is None


def test_jumps_of_runs_that_are_made_to_break_are_no_news_for_the_terminal(bare):
    jumps = replace(bare, jumps=((Trial("b", "amcl", 0, "tf_delay.odometry", 1.0, "s"), (None,)),))

    assert list(jump_lines(jumps)) == []
