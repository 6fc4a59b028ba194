"""The benchmark plays every kind, scores what it is told to, and goes on where it stopped."""

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from slamreplay.bench import runner
from slamreplay.bench.baselines import misalignment
from slamreplay.bench.conditions import CONDITIONS
from slamreplay.bench.goals import missed, parse_goals
from slamreplay.bench.incidents import KINDS
from slamreplay.bench.measure import Measured, measured
from slamreplay.bench.rates import auc, best_f1, f1, share
from slamreplay.bench.schedule import DEFAULT_LOGS, HELD_FROM, Case, schedule
from slamreplay.bench.scores import calibration, hindsight_size, named, scores
from slamreplay.bench.store import read_measured, write_measured
from slamreplay.bench.table import page
from slamreplay.consistency.evidence.hindsight_size import (
    hindsight_size_of,
    measured_hindsight_size,
)
from slamreplay.errors import OutputError, UsageError
from slamreplay.verdict.reliability import measured_reliability, reliability_of

N = 200


def made_up(
    kind="wheel_slip", seed=1, *, late=0, state="lost", judged="lost", sure=0.95, **moments
):
    """A log of 20 s, lost from 5 to 10 s; judged so `late` samples later."""
    t_s = np.arange(N) * 0.1
    lost = (t_s >= 5.0) & (t_s < 10.0)
    no = np.zeros(N, dtype=bool)
    values = {
        "t_s": t_s,
        "lost": lost,
        "changed": no,
        "judged_lost": np.roll(lost, late),
        "judged_changed": no,
        "unjudged": no,
        "confidence": np.full(N, sure),
        "error_m": np.full(N, 0.02),
        "error_rad": np.full(N, 0.01),
        "ratio": np.where(lost, 3.0, 0.2),
        "covariance": np.full(N, 0.1),
        "mean_absolute_error": np.where(lost, 0.5, 0.1),
        "beams_off": np.full(N, np.nan),
        "misalignment_mrf": np.full(N, 0.2),
        **moments,
    }
    facts = {
        "state": state, "judged": judged, "confidence": sure, "failure_mode": "none",
        "findings": [], "coverage": 1.0, "margin": None, "regions": 0, "regions_found": 0,
        "missed_regions": [], "false_area_m2": 0.0, "judged_area_m2": 0.0,
    }  # fmt: skip
    return Measured(Case(kind, seed), facts, values)


def test_schedule_plays_every_kind_ten_times_and_every_condition():
    cases = schedule()

    assert len(cases) == DEFAULT_LOGS >= 300
    assert len(set(cases)) == len(cases)
    for kind in KINDS:
        assert sum(c.kind == kind and not c.conditions for c in cases) >= 10
    for name in CONDITIONS:
        assert len({c.kind for c in cases if name in c.conditions}) >= 10


def test_held_and_developing_seeds_never_meet_and_short_is_the_beginning_of_long():
    held, train = schedule(52), schedule(52, split="train")

    assert not {c.seed for c in held} & {c.seed for c in train}
    assert min(c.seed for c in held) >= HELD_FROM > max(c.seed for c in train)
    assert not {c.seed for c in schedule(26, seed=1)} & {c.seed for c in held}
    assert schedule(30) == held[:30]


def test_delay_is_counted_and_edges_are_left_out_but_shown():
    found = scores([made_up(late=3), made_up(seed=3)])

    assert found["lost"]["f1"][0] == 1.0
    assert found["lost_with_edges"]["precision"][0] == pytest.approx(97 / 100)
    assert found["lost_with_edges"]["recall"][0] == pytest.approx(97 / 100)
    assert found["lost"]["delay_s"]["p95"] == pytest.approx(0.3, abs=0.05)
    assert found["log_accuracy"][0] == 1.0


def test_mistakes_show_up_where_they_belong():
    alarmed = made_up(
        "healthy", state="healthy", judged="lost",
        lost=np.zeros(N, dtype=bool), judged_lost=np.arange(N) < 100,
    )  # fmt: skip
    foreign = made_up("wrong_map", state="insufficient_data", judged="healthy")

    found = scores([made_up(), alarmed, foreign])

    assert found["lost_on_healthy_logs"] == 1
    assert found["log_accuracy"][0] == 0.5
    assert found["wrong_map_told"][0] == 0.0
    assert found["lost"]["precision"][0] < 0.5
    assert found["lost"]["recall"][0] == 1.0


def test_failed_log_counts_as_wrong():
    broken = Measured(
        Case("push", 7), {"error": "oops", "judged": None, "state": None, "findings": []}
    )

    results = runner.results_of([made_up(), broken], 0, "held")

    assert results["scores"]["failed"] == 1
    assert results["scores"]["log_accuracy"][0] == 0.5
    assert "oops" in page(results)


def test_calibration_sees_overconfidence():
    honest = calibration([made_up(sure=1.0)])
    boasting = calibration([made_up(sure=0.95, judged_lost=np.zeros(N, dtype=bool))])

    assert honest["ece"][0] == 0.0
    assert boasting["ece"][0] == pytest.approx(0.17, abs=0.03)


def test_one_identical_aisle_off_is_told_from_changed():
    no = np.zeros(N, dtype=bool)
    calm = np.full(N, 0.2)
    changed = made_up("boxes_added", state="map_changed", lost=no, changed=~no, ratio=calm)
    found = scores([made_up("identical_aisles"), made_up("wheel_slip"), changed])

    assert found["auc_identical_aisle_against_changed"][0] == 1.0
    blind = replace(changed, moments={**changed.moments, "ratio": np.full(N, 4.0)})
    worse = scores([made_up("identical_aisles"), blind])
    assert worse["auc_identical_aisle_against_changed"][0] == 0.0


def test_wrongly_judged_log_gets_its_report(tmp_path, monkeypatch):
    wrote = []
    monkeypatch.setattr(
        runner,
        "measured",
        lambda c: replace(made_up(judged="healthy" if c.seed else "lost"), case=c),
    )
    monkeypatch.setattr(runner, "write_case", lambda case, folder: wrote.append((case, folder)))

    runner.run_benchmark(
        tmp_path, logs=2, kinds=["push"], conditions=[], split="train", jobs=1, reports=True
    )

    assert wrote == [(Case("push", 1), tmp_path / "failures")]
    assert "| push | none 2 |" in (tmp_path / "results.md").read_text(encoding="utf-8")


def test_failure_modes_are_counted_most_frequent_first():
    drift, slip = made_up(), made_up()
    slip.facts["failure_mode"] = "odometry_slip"

    assert list(named([drift, slip, slip]).items()) == [("odometry_slip", 2), ("none", 1)]


def test_baselines_are_scored_beside():
    found = scores([made_up(seed=1), made_up(seed=3)])["baselines"]

    assert found["mean_absolute_error"]["auc_lost"][0] == 1.0
    assert found["mean_absolute_error"]["f1_lost_field"][0] == 1.0
    assert found["covariance"]["auc_lost"][0] == 0.5
    assert found["covariance"]["f1_lost_field"][0] == 0.0


def test_rates_are_what_their_definitions_say():
    rng = np.random.Generator(np.random.PCG64(0))
    truth, score, log = rng.random(300) < 0.4, rng.normal(size=300), np.arange(300) % 7
    score = np.round(score + truth, 1)
    pairs = score[truth][:, None] - score[~truth][None, :]

    found = auc(score, truth, log, 7)
    threshold, best = best_f1(score, truth)
    each = [2 * (truth & (score >= t)).sum() / (truth.sum() + (score >= t).sum()) for t in score]

    assert found.value == pytest.approx(((pairs > 0) + 0.5 * (pairs == 0)).mean())
    assert found.low < found.value < found.high
    assert best == pytest.approx(max(each))
    assert each[int(np.argmax(score == threshold))] == pytest.approx(best)
    assert share(np.array([1, 1]), np.array([2, 2])).value == 0.5
    assert f1(np.zeros(3), np.ones(3), np.zeros(3)).value is None


def test_interval_is_wider_where_logs_differ():
    alike = share(np.full(20, 5), np.full(20, 10))
    differing = share(np.tile([0, 10], 10), np.full(20, 10))

    assert alike.high - alike.low < 1e-9
    assert differing.high - differing.low > 0.2


def test_stopped_run_goes_on_and_other_code_begins_anew(tmp_path, monkeypatch):
    played = []

    def play(case):
        played.append(case)
        return replace(made_up(), case=case)

    monkeypatch.setattr(runner, "measured", play)
    target = tmp_path / "out"
    runner.run_benchmark(target, logs=2, jobs=1)
    first = (target / "results.json").read_bytes()
    runner.run_benchmark(target, logs=3, jobs=1)
    assert len(played) == 3

    runner.run_benchmark(target, logs=2, jobs=1)
    assert (target / "results.json").read_bytes() == first
    assert json.loads(first)["complete"] is True

    monkeypatch.setattr(runner, "fingerprint", lambda: "other code")
    runner.run_benchmark(target, logs=2, jobs=1)
    assert len(played) == 5

    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("mine")
    with pytest.raises(OutputError):
        runner.run_benchmark(tmp_path / "mine", logs=1, jobs=1)


def test_cut_result_is_made_again(tmp_path):
    one = made_up()
    write_measured(tmp_path, one, "code")
    back = read_measured(tmp_path, one.case, "code")
    path = next(tmp_path.iterdir())
    path.write_bytes(path.read_bytes()[:300])

    assert back.facts == one.facts
    np.testing.assert_array_equal(back.moments["ratio"], one.moments["ratio"])
    assert read_measured(tmp_path, one.case, "code") is None


def test_log_with_boxes_is_judged_beside_its_truth():
    one = measured(Case("boxes_added", 0))

    assert one.facts["state"] == one.facts["judged"] == "map_changed"
    assert one.facts["regions_found"] >= 0.7 * one.facts["regions"] > 0
    assert np.nanmedian(one.moments["error_m"]) < 0.05
    assert np.isfinite(one.moments["beams_off"]).mean() > 0.9
    assert scores([one])["changed"]["f1"][0] > 0.9


def test_command_prints_the_tables(tmp_path, monkeypatch):
    from slamreplay.cli.main import COMMANDS, app

    assert "bench" in COMMANDS
    monkeypatch.setattr(
        runner,
        "measured",
        lambda case: replace(made_up(nees_xy=np.full(N, 8.0), nees_yaw=np.ones(N)), case=case),
    )
    from slamreplay.cli import bench

    if not any(g.name == "bench" for g in app.registered_groups):
        bench.register(app)
    target = tmp_path / "out"
    words = ["bench", "verdict", "--logs", "30", "--jobs", "1", "-o", str(target)]

    result = CliRunner().invoke(app, words)

    assert result.exit_code == 0, result.output
    assert "| lost, F1 per moment |" in result.stdout
    assert ">= 0.995" in result.stdout
    assert json.loads((target / "results.json").read_text())["scores"]["logs"] == 30
    record = reliability_of(json.loads((target / "reliability.json").read_text()))
    assert record.logs == 30
    assert record.moments > 1000
    size = hindsight_size_of(json.loads((target / "hindsight_size.json").read_text()))
    assert (size.logs, size.split, size.position, size.heading) == (30, "held", 2.0, 1.0)
    assert (target / "reliability.svg").read_bytes().startswith(b"<?xml")

    refused = CliRunner().invoke(app, [*words, "--at-least", "calibration.ece=0.5"])

    assert refused.exit_code == 1
    assert "calibration.ece is" in refused.stderr


def test_residuals_of_a_wrong_pose_are_called_misaligned():
    rng = np.random.Generator(np.random.PCG64(0))
    right, wrong = np.abs(rng.normal(0.0, 0.03, 200)), rng.exponential(0.35, 200)

    assert misalignment(right) < 0.5
    assert misalignment(wrong[wrong < 1.0]) > 1.0


def test_goals_are_bounds_on_figures():
    found = scores([made_up(), made_up(seed=2, judged="healthy", late=100)])

    assert not missed(found, parse_goals(["lost.precision=0.3", "log_accuracy=0.5"], ">="))
    assert missed(found, parse_goals(["log_accuracy=0.9"], ">=")) == [
        "log_accuracy is 0.5, wanted >= 0.9"
    ]
    assert not missed(found, parse_goals(["lost_on_healthy_logs=0"], "<="))
    # What could not be measured was not reached.
    assert missed(found, parse_goals(["wrong_map_told=1"], ">="))


@pytest.mark.parametrize("text", ["lost.f1", "lost.f1=much", "", "=0.3x"])
def test_goal_without_a_number_is_refused(text):
    with pytest.raises(UsageError, match="no FIGURE=NUMBER"):
        parse_goals([text], ">=")


@pytest.mark.parametrize("name", ["found", "lost.f2", "calibration.bins.x", "calibration.bins",
                                  "lost"])  # fmt: skip
def test_goal_for_a_figure_that_is_not_there_is_refused(name):
    with pytest.raises(UsageError):
        missed(scores([made_up()]), parse_goals([f"{name}=0.5"], ">="))


def test_hindsights_size_counts_each_log_alike(tmp_path):
    rng = np.random.default_rng(4)
    logs = [
        made_up(seed=k, nees_xy=xy * rng.chisquare(2, N), nees_yaw=yaw * rng.chisquare(1, N))
        for k, (xy, yaw) in enumerate([(1.0, 0.25), (1.0, 0.25), (9.0, 0.25)])
    ]
    logs[0].moments["nees_xy"][: N // 2] = np.nan  # no place there
    size = hindsight_size([*logs, made_up(seed=9)], 3, "train")

    assert (size.logs, size.seed, size.split) == (3, 3, "train")
    assert size.position == pytest.approx(np.sqrt((1.0 + 1.0 + 9.0) / 3.0), rel=0.1)
    assert size.typical_position == pytest.approx(1.0, rel=0.1)
    assert size.heading == pytest.approx(0.5, rel=0.1)
    assert size.typical_position < size.position < size.most_position < 3.2
    assert hindsight_size([made_up()], 3, "train") is None
    write_measured(tmp_path, logs[1], "code")
    kept = read_measured(tmp_path, logs[1].case, "code")
    np.testing.assert_array_equal(kept.moments["nees_xy"], logs[1].moments["nees_xy"])


def test_shipped_size_of_hindsight_was_measured_on_logs_to_develop_with():
    size = measured_hindsight_size()

    assert size.split == "train"
    assert size.logs >= 40
    assert hindsight_size_of(json.loads(json.dumps(size.as_json()))) == size


def test_shipped_reliability_was_measured_on_many_moments():
    record = measured_reliability()

    assert record.logs >= 20
    assert record.ece is not None
    assert reliability_of(json.loads(json.dumps(record.as_json()))) == record
    best = record.bin_of(0.99)
    assert best is not None
    assert best.moments > 1000
    assert best.right > 0.9


def test_sustained_level_is_what_the_verdicts_rule_would_keep():
    from slamreplay.bench.measure import sustained
    from slamreplay.verdict.limits import Limits
    from slamreplay.verdict.timeline import BAD, GOOD, held, settled

    rng = np.random.default_rng(3)
    t_ns = np.arange(0, 400, dtype=np.int64) * 100_000_000
    values = np.repeat(rng.uniform(0.0, 3.0, 40), 10)
    limits = Limits()
    level = sustained(t_ns, values, t_ns, limits)
    for limit in (0.5, 1.0, 1.7):
        flags = np.where(values > limit, BAD, GOOD).astype(np.int8)
        line = settled(held(t_ns, flags, 0, int(t_ns[-1]) + 1, 10**9), 3 * 10**9, 10**9)
        bad = [(s.start_ns, s.end_ns) for s in line if s.value == BAD]
        said = np.array([any(a <= t < b for a, b in bad) for t in t_ns])
        assert np.mean(said == (level > limit)) > 0.98
