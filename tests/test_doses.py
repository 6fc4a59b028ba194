"""A design whose answer is known: an estimator that is wrong by what it is told."""

import json
from dataclasses import replace

import numpy as np
import pytest

from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.store import write_bundle
from slamreplay.bundle.track import PoseTrack
from slamreplay.bundle.view import Bundle
from slamreplay.doses import trials
from slamreplay.doses.answer import answer
from slamreplay.doses.carried import carried
from slamreplay.doses.folder import write_answer
from slamreplay.doses.metrics import METRICS, limit_of
from slamreplay.doses.page import results_page
from slamreplay.doses.plan import Dose, Plan, of_levels, of_search
from slamreplay.errors import BundleError
from slamreplay.estimators import ESTIMATORS
from slamreplay.perturb import PERTURBATIONS
from slamreplay.replay import runner
from slamreplay.replay.dose_file import doses_json, read_doses
from slamreplay.replay.dose_ranking import ranking
from slamreplay.replay.folder import read_runs
from slamreplay.replay.run_cache import run_file
from slamreplay.replay.runner import Replayer
from slamreplay.report.dose_tables import critical_rows, notes, ranking_rows, words_of
from slamreplay.report.figures.doses import doses_figure
from slamreplay.testing.synthetic import synthetic_bundle


@pytest.fixture(autouse=True)
def toys(monkeypatch):
    for name in ("Told", "Scattered", "Elsewhere", "Deaf"):
        monkeypatch.setitem(ESTIMATORS.targets(), name.lower(), f"dose_world:{name}")
    monkeypatch.setitem(PERTURBATIONS.targets(), "wrong", "dose_world:Wrong")


@pytest.fixture(scope="module")
def bundle():
    return synthetic_bundle(seconds=6.0)


def plan(*axes, estimators=("told",), limits=(("error_max_m", 0.5),), seeds=5, control=50.0):
    return Plan(
        "How wrong may it be told to be?",
        tuple(range(1, seeds + 1)),
        tuple(estimators),
        tuple(limit_of(*limit) for limit in limits),
        tuple(axes),
        Dose("wrong.by", "m", control),
    )


def only(found):
    (curve,) = found.results.curves
    return curve


def test_levels_bracket_the_limit_and_paired_differences_are_the_dose(bundle):
    curve = only(answer(bundle, plan(of_levels("wrong.by", [0.2, 0.4, 0.8, 1.6]))))

    (critical,) = curve.critical
    assert (critical.outcome, critical.level, critical.low) == ("crossed", 0.8, 0.4)
    assert [response.level for response in curve.responses] == [0.0, 0.2, 0.4, 0.8, 1.6]
    assert curve.judged_by == "simulation"
    assert curve.broke_first == "error_max_m"
    for response in curve.responses[1:]:
        found = response.paired["error_max_m"]
        assert found.mean == pytest.approx(response.level, rel=1e-3)


def test_a_design_asked_again_measures_nothing_anew(bundle, tmp_path, monkeypatch):
    tables = {name: bundle.table(name) for name in TABLES}
    write_bundle(tmp_path / "b", bundle.manifest, tables, {"room": bundle.grid()})
    there, asked = Bundle.open(tmp_path / "b"), plan(of_levels("wrong.by", [0.2, 0.8]))
    done, fresh = [], trials.measured
    monkeypatch.setattr(trials, "measured", lambda *a: done.append(a[0].trial) or fresh(*a))

    first = answer(there, asked, cache=tmp_path / "c")
    count = len(done)
    again = answer(there, asked, cache=tmp_path / "c")

    assert count == len(set(done)) == len(done) == first.trials
    assert again.results == first.results
    answer(bundle, asked, cache=tmp_path / "c")  # one in memory is nobody's that can be told
    answer(bundle, asked, cache=tmp_path / "c")
    assert len(done) == 3 * count


def test_nothing_is_replayed_five_times_where_nothing_is_drawn(bundle, monkeypatch):
    ran = []
    fresh = runner.run_trial
    monkeypatch.setattr(runner, "run_trial", lambda b, t: ran.append(t) or fresh(b, t))

    curve = only(answer(bundle, plan(of_levels("wrong.by", [0.2, 0.8]))))

    # two baselines (do they differ?), the no-op, the positive control and two levels
    assert len(ran) == 6
    assert curve.seeds == (1,)
    assert not curve.is_random
    assert curve.critical[0].confidence is None
    assert "one run stands for all seeds" in curve.notes[0]
    assert curve.responses[1].paired["error_max_m"].low is None


@pytest.mark.parametrize(
    ("estimator", "variant"), [("scattered", "by"), ("told", "drawn"), ("scattered", "drawn")]
)
def test_what_is_drawn_is_replayed_over_the_seeds(bundle, estimator, variant):
    axis = of_levels(f"wrong.{variant}", [0.01, 3.0])

    curve = only(answer(bundle, plan(axis, estimators=[estimator])))

    assert curve.is_random
    assert curve.seeds == (1, 2, 3, 4, 5)
    assert len(set(curve.responses[2].values["error_max_m"])) == 5
    critical = curve.critical[0]
    assert (critical.level, critical.low, critical.high) == (3.0, 0.01, 3.0)
    assert critical.confidence == 0.9375
    assert critical.crossed == critical.seeds == 5


def test_one_baseline_stands_for_those_of_all_seeds(bundle):
    """The first two show that nothing is drawn undisturbed; the others are not replayed."""
    curve = only(
        answer(bundle, plan(of_levels("wrong.drawn", [3.0]), limits=[("baseline_max_m", 1)]))
    )

    assert None not in curve.responses[1].values["baseline_max_m"]
    assert curve.critical[0].crossed == 5


def test_pairs_share_the_seed(bundle):
    """The scatter of the seeds is in both runs and drops out."""
    axis = of_levels("wrong.by", [1.0])

    curve = only(answer(bundle, plan(axis, estimators=["scattered"])))

    found = curve.responses[1].paired["error_max_m"]
    assert found.mean == pytest.approx(1.0, abs=1e-4)
    assert found.high - found.low < 1e-3
    assert found.n == 5


def test_a_search_finds_the_critical_level_within_its_tolerance(bundle):
    axis = of_search("wrong.by", 0.0, 10.0, 0.05)

    critical = only(answer(bundle, plan(axis))).critical[0]

    assert critical.low < 0.5 + 0.01
    assert critical.level >= 0.5 - 0.01
    assert critical.level - critical.low <= 0.05 * 1.001


def test_a_search_over_seeds_covers_the_median_and_is_no_tighter_than_its_brackets(bundle):
    axis = of_search("wrong.drawn", 0.0, 1.0, 0.02)

    curve = only(answer(bundle, plan(axis, seeds=7)))

    critical = curve.critical[0]
    assert 0.25 <= critical.low < critical.level <= critical.high <= 0.52
    assert critical.high - critical.low >= 0.02 * 0.5
    assert critical.confidence >= 0.95


def test_below_the_baseline(bundle):
    critical = only(answer(bundle, plan(of_levels("wrong.shrunk", [0.98, 0.9, 0.8])))).critical[0]

    assert (critical.level, critical.low) == (0.9, 0.98)


def test_a_response_that_turns_back_is_told(bundle):
    curve = only(answer(bundle, plan(of_levels("wrong.hump", [0.1, 1.0, 8.0]))))

    assert curve.critical[0].level == 1.0
    assert "keeps its limit again at 8 m" in curve.notes[0]


def test_no_pose_at_all_is_broken(bundle):
    limits = [("lost_s", 1.0), ("unposed_share", 0.5), ("ate_aligned_m", 0.5), ("relations_m", 1.0)]

    curve = only(answer(bundle, plan(of_levels("wrong.blind", [1.0, 4.0]), limits=limits)))

    assert [c.level for c in curve.critical] == [4.0, 4.0, 4.0, None]
    assert curve.critical[3].outcome == "not_applicable"  # this log has no relations
    assert curve.responses[2].values["unposed_share"] == (1.0,)
    assert "error_max_m" not in curve.responses[2].values  # endless: no number in a file


def test_a_level_that_the_log_does_not_allow_is_told_and_is_no_break(bundle):
    curve = only(answer(bundle, plan(of_levels("wrong.short", [0.1, 0.2, 4.0]))))

    assert curve.critical[0].outcome == "never"
    assert curve.critical[0].low == 0.2
    assert "4 s is not applicable: the log is too short" in curve.notes[0]


def test_what_has_no_number_at_its_last_level_is_not_held_to_its_end(bundle):
    axes = of_levels("wrong.short", [0.1, 0.2, 4.0]), of_levels("wrong.by", [0.1])

    found = answer(bundle, plan(*axes)).results

    short, whole = (row[-1] for row in ranking_rows(found)[1:])
    assert short.startswith("held up to 0.2 s")
    assert whole == "held to its end"


def test_seeds_without_a_number_are_told(bundle):
    curve = only(answer(bundle, plan(of_levels("wrong.unsure", [0.1, 1.0]), seeds=8)))

    many = curve.responses[2].values["error_max_m"].count(None)
    assert 0 < many < 8
    told = f"no number at 1 m with {many} of 8 seeds (this seed refuses)"
    assert any(told in note for note in curve.notes)


def test_a_judge_is_named_for_the_limits_it_speaks_of(bundle):
    limits = [("ate_aligned_m", 0.5), ("baseline_max_m", 0.5)]

    aligned = notes(answer(bundle, plan(of_levels("wrong.by", [0.1]), limits=limits)).results)
    plain = notes(answer(bundle, plan(of_levels("wrong.by", [0.1]))).results)

    assert any("laid onto it" in note for note in aligned)
    assert any("own undisturbed run" in note for note in aligned)
    assert not any("nothing aligned" in note for note in aligned)
    assert any("nothing aligned" in note for note in plain)


def test_a_curve_without_any_level_says_why(bundle):
    curve = only(answer(bundle, plan(of_levels("wrong.short", [4.0, 5.0]))))

    assert curve.reason == "the log is too short"
    assert curve.critical == ()


def test_an_estimator_that_cannot_run_says_why_and_has_no_controls():
    log = synthetic_bundle(seconds=3.0, with_map=False)

    found = answer(log, plan(of_levels("wrong.by", [1.0]), estimators=["amcl", "told"]))

    assert "needs a map" in found.results.curves[0].reason
    assert found.results.curves[1].broke_first == "error_max_m"
    assert {c.estimator for c in found.results.controls} == {"told"}


def test_every_perturbation_has_a_no_op_that_is_really_run(bundle, monkeypatch):
    ran = []
    fresh = runner.run_trial
    monkeypatch.setattr(runner, "run_trial", lambda b, t: ran.append(t) or fresh(b, t))

    found = answer(bundle, plan(of_levels("wrong.by", [1.0]), of_levels("wrong.hump", [1.0])))

    no_ops = [c for c in found.results.controls if c.kind == "no_op"]
    assert [(c.perturbation, c.level, c.passed) for c in no_ops] == [
        ("wrong.by", 0.0, True),
        ("wrong.hump", 0.0, True),
    ]
    assert sum(t.level == 0.0 for t in ran) == 2
    assert all(run.trial.level != 0.0 for run in found.runs)  # they are no part of the answer


def test_a_perturbation_that_changes_the_run_at_its_baseline_is_told_loudly(bundle):
    found = answer(bundle, plan(of_levels("wrong.leaky", [1.0])))

    (no_op,) = [c for c in found.results.controls if c.kind == "no_op"]
    assert no_op.passed is False
    assert notes(found.results)[0].startswith("NO-OP CONTROL FAILED: told, wrong.leaky at 0 m")
    assert critical_rows(found.results)[1][-1] == "NO-OP FAILED"
    assert "NO-OP CONTROL FAILED" in results_page(found.results, ())


def test_a_positive_control_that_breaks_nothing_is_told_loudly(bundle):
    found = answer(bundle, plan(of_levels("wrong.by", [1.0]), estimators=["deaf"]))

    (positive,) = [c for c in found.results.controls if c.kind == "positive"]
    assert positive.passed is False
    assert "crosses no limit" in positive.text
    assert notes(found.results)[0].startswith("POSITIVE CONTROL FAILED: deaf, wrong.by at 50 m")


def test_a_positive_control_that_leaves_no_number_is_told_apart(bundle):
    """Of a path without its poses no relation can be said to be wrong."""
    found = answer(
        bundle,
        replace(
            plan(of_levels("wrong.by", [0.1]), limits=[("nees_mean", 1e9)]),
            positive_control=Dose("wrong.blind", "m", 50.0),
        ),
    ).results

    (control,) = (c for c in found.controls if c.kind == "positive")
    assert control.passed is False
    assert "too few poses for nees_mean" in control.text


def test_a_baseline_beyond_its_limit_is_told_and_shows_nothing(bundle):
    limits = [("error_max_m", 0.05)]

    found = answer(bundle, plan(of_levels("wrong.by", [1.0]), estimators=["scattered"],
                                limits=limits))  # fmt: skip

    critical = only(found).critical[0]
    assert (critical.outcome, critical.level) == ("always", 0.0)
    assert only(found).broke_first is None  # no dose is to blame
    assert "beyond its limit undisturbed" in only(found).notes[0]
    assert ranking(found.results)[0].undisturbed == ("error_max_m",)
    assert critical_rows(found.results)[1][4] == "nothing more"
    (positive,) = [c for c in found.results.controls if c.kind == "positive"]
    assert positive.passed is False
    assert "undisturbed" in positive.text


def test_usual_positive_controls_are_tried_until_one_breaks(bundle):
    one = plan(of_levels("scan_drop.even", [0.5]), estimators=["dead_reckoning"])
    one = Plan(*(getattr(one, name) for name in ("question", "seeds", "estimators", "limits",
                                                 "axes")))  # fmt: skip

    found = answer(bundle, one)

    (positive,) = [c for c in found.results.controls if c.kind == "positive"]
    assert (positive.perturbation, positive.level, positive.passed) == (
        "initial_pose.offset", 20.0, True
    )  # fmt: skip


def test_a_positive_control_that_is_told_of_was_run(bundle, monkeypatch):
    ran, fresh = [], runner.run_trial
    monkeypatch.setattr(runner, "run_trial", lambda b, t: ran.append(t) or fresh(b, t))
    one = plan(of_levels("wrong.by", [1.0]), estimators=["scattered"],
               limits=[("error_max_m", 0.05)])  # fmt: skip

    found = answer(bundle, replace(one, positive_control=None))

    (positive,) = [c for c in found.results.controls if c.kind == "positive"]
    assert "beyond its limit undisturbed" in positive.text
    assert (positive.perturbation, positive.level) in {(t.perturbation, t.level) for t in ran}


def test_another_frame_falls_back_to_the_own_baseline_and_says_so(bundle):
    found = answer(
        bundle, plan(of_levels("wrong.by", [1.0]), estimators=["told", "elsewhere"])
    )  # fmt: skip

    assert [c.judged_by for c in found.results.curves] == ["simulation", "baseline"]
    assert found.results.judged_by == "simulation, baseline"
    alone = found.results.curves[1]
    assert alone.responses[0].values["error_max_m"] == (0.0,)
    assert alone.responses[1].values["error_max_m"][0] == pytest.approx(1.0)
    assert "nees_mean" not in alone.responses[1].values  # a run is no judge of its covariance
    assert any("elsewhere by baseline" in note for note in notes(found.results))


def test_hindsight_judges_where_no_reference_does_and_is_kept(tmp_path):
    made = synthetic_bundle(seconds=5.0)
    tables = {name: made.table(name) for name in TABLES if name != "references"}
    write_bundle(tmp_path / "b", made.manifest, tables, {"room": made.grid()})
    log, asked = Bundle.open(tmp_path / "b"), plan(of_levels("wrong.by", [1.0]))

    first = answer(log, asked, cache=tmp_path / "cache")
    kept = list((tmp_path / "cache" / "hindsight").iterdir())
    again = answer(log, asked, cache=tmp_path / "cache")

    assert first.results.judged_by == "hindsight"
    assert only(first).responses[1].values["error_max_m"][0] == pytest.approx(1.0, abs=0.15)
    assert len(kept) == 1
    assert first.results == again.results


def test_what_breaks_first_is_the_least_level_and_curves_rank_by_their_range(bundle):
    limits = [("error_max_m", 2.0), ("error_median_m", 0.5)]
    axes = of_levels("wrong.by", [0.3, 1.0, 3.0, 10.0]), of_levels("wrong.hump", [1.0, 2.0])

    found = answer(bundle, plan(*axes, estimators=["told", "deaf"], limits=limits))

    by = found.results.curves[0]
    assert [c.level for c in by.critical] == [3.0, 1.0]
    assert by.broke_first == "error_median_m"
    assert [(m.estimator, m.perturbation, m.share) for m in ranking(found.results)] == [
        ("told", "wrong.by", 0.1),
        ("told", "wrong.hump", 0.5),
        ("deaf", "wrong.by", None),
        ("deaf", "wrong.hump", None),
    ]


def test_a_scale_is_drawn_and_ranked_by_its_logarithm(bundle):
    results = answer(bundle, plan(of_levels("wrong.shrunk", [0.1, 0.01]))).results

    axes = doses_figure(results, {}).axes[0]

    assert axes.lines[0].get_xdata() == pytest.approx([0.0, -1.0, -2.0])
    assert [label.get_text() for label in axes.get_xticklabels()][-1] == "1"
    assert [margin.share for margin in ranking(results)] == [0.5]


def test_levels_far_from_their_baseline_are_drawn_apart_from_each_other(bundle):
    results = answer(bundle, plan(of_levels("wrong.shrunk", [0.02, 0.01, 0.0]))).results

    axes = doses_figure(results, {"wrong.shrunk": "words " * 30}).axes[0]

    x = axes.lines[0].get_xdata()
    apart = -np.diff(x)
    assert x[1:] == pytest.approx([0.02, 0.01, 0.0])  # 0 is in no logarithm: this is no scale
    assert 0.0 < apart[0] < 2.0 * apart[1]
    assert axes.get_xticklabels()[0].get_text() == "1"
    assert axes.get_ylabel() == "greatest error [m]"
    assert all(len(line) <= 56 for line in axes.texts[0].get_text().splitlines())


def test_every_metric_is_measured_or_there_is_none(bundle):
    curve = only(answer(bundle, plan(of_levels("wrong.by", [1.0]))))

    values = curve.responses[1].values
    assert set(values) == set(METRICS) - {"relations_m", "relations_rad"}
    assert values["error_rmse_m"][0] == pytest.approx(1.0, rel=1e-3)
    assert values["error_final_m"][0] == pytest.approx(1.0, rel=1e-3)
    assert values["lost_s"][0] == pytest.approx(5.9, abs=0.2)
    assert values["lost_share"] == (1.0,)
    assert values["sigma_m"][0] == pytest.approx(0.1, rel=1e-2)
    assert values["nees_mean"][0] == pytest.approx(100.0, rel=0.1)
    assert values["nees_interval_ratio"][0] > 1.0


def test_between_its_rows_a_run_is_carried_on_by_odometry():
    """Two scans lost a run is not judged at two moments fewer."""
    t_ns = np.arange(4, dtype=np.int64) * 10**8
    path = np.column_stack([np.arange(4.0), np.zeros(4), np.zeros(4)])
    odometry = PoseTrack.without_covariance("odom", "base", t_ns, path)
    turned = np.array([[5.0, 5.0, np.pi / 2]])
    run = PoseTrack.without_covariance("map", "base", t_ns[1:2], turned)

    assert carried(run, odometry, t_ns).xyyaw[:, :2] == pytest.approx(
        np.array([[np.nan, np.nan], [5, 5], [5, 6], [5, 7]]), nan_ok=True
    )
    alone = carried(run, None, t_ns).xyyaw[:, 0]
    assert alone == pytest.approx(np.array([np.nan, 5, np.nan, np.nan]), nan_ok=True)


def test_the_answer_is_written_whole_read_back_and_stays_a_folder_of_runs(bundle, tmp_path):
    tables = {name: bundle.table(name) for name in TABLES}
    write_bundle(tmp_path / "b", bundle.manifest, tables, {"room": bundle.grid()})
    log = Bundle.open(tmp_path / "b")
    asked = plan(
        of_levels("wrong.shrunk", [0.9, 0.5]), of_search("wrong.blind", 0.1, 10.0, 0.5),
        estimators=["told", "scattered"], seeds=2,
    )  # fmt: skip

    found = answer(log, asked)
    for folder in ("one", "two"):
        write_answer(tmp_path / folder, log, asked, found, {"bundle_id": "x"})

    assert read_doses(tmp_path / "one") == found.results
    names = {path.name for path in (tmp_path / "one").iterdir()}
    assert names == {"runs", "runs.json", "doses.json", "results.json", "results.md",
                     "doses.png", "doses.svg"}  # fmt: skip
    for name in names - {"runs"}:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    runs = read_runs(tmp_path / "one")[1]
    assert [run.trial.perturbation for run in runs][:2] == [None, None]
    assert {run.trial.seed for run in runs} == {1}
    content = json.loads((tmp_path / "one" / "results.json").read_text())
    assert set(content["results"]["curves"]) == {"wrong.shrunk below 1", "wrong.blind"}
    assert content["results"]["controls_hold"] is True


def test_a_damaged_answer_is_refused_in_one_line(tmp_path):
    assert read_doses(tmp_path) is None
    for text in ("", "[]", "{}", '{"doses_format": 1}', '{"doses_format": 1, "question": 3}'):
        (tmp_path / "doses.json").write_text(text)
        with pytest.raises(BundleError, match="not a readable answer"):
            read_doses(tmp_path)
    (tmp_path / "doses.json").write_text('{"doses_format": 99}')
    with pytest.raises(BundleError, match="doses format 99"):
        read_doses(tmp_path)


def test_scans_that_are_missing_are_moments_that_count(bundle):
    """At its rows this estimator is right; between them odometry drifts."""
    curve = only(answer(bundle, plan(of_levels("scan_drop.even", [0.95]))))

    undisturbed, dropped = (r.values["error_max_m"][0] for r in curve.responses)
    assert dropped > undisturbed + 0.001
    assert curve.responses[1].values["unposed_share"] == pytest.approx((0.0,), abs=0.35)


@pytest.mark.parametrize("part", ["limits", "responses", "critical"])
def test_an_answer_that_lost_a_part_is_refused(bundle, tmp_path, part):
    found = answer(bundle, plan(of_levels("wrong.by", [1.0])))
    content = json.loads(doses_json(found.results))
    (content if part == "limits" else content["curves"][0])[part] = []
    (tmp_path / "doses.json").write_text(json.dumps(content))

    with pytest.raises(BundleError, match="not a readable answer"):
        read_doses(tmp_path)


def test_what_a_level_does_is_not_told_of_a_perturbation_that_is_gone(bundle, monkeypatch):
    results = answer(bundle, plan(of_levels("wrong.by", [1.0]))).results
    assert words_of(results) == {"wrong.by": "off by this much"}

    monkeypatch.delitem(PERTURBATIONS.targets(), "wrong")

    assert words_of(results) == {"wrong.by": ""}


def test_what_is_asked_for_in_any_case_goes_to_all_cores_as_one_round(
    bundle, tmp_path, monkeypatch
):
    tables = {name: bundle.table(name) for name in TABLES}
    write_bundle(tmp_path / "b", bundle.manifest, tables, {"room": bundle.grid()})
    there, rounds, replay = Bundle.open(tmp_path / "b"), [], Replayer.replay

    def counted(self, asked, **more):
        rounds.append([t for t in asked if not run_file(t, tmp_path / "runs").exists()])
        return replay(self, asked, **more)

    monkeypatch.setattr(Replayer, "replay", counted)
    answer(there, plan(of_levels("wrong.by", [0.2, 0.8]), seeds=1), cache=tmp_path)

    assert [len(asked) for asked in rounds if asked] == [len(rounds[0])]
    assert {t.level for t in rounds[0]} >= {None, 0.0, 0.2, 0.8}
