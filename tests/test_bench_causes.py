"""What an incident is known to have been caused by, and how naming that cause is scored."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from slamreplay.bench.cause_fit import Played, record_of, said
from slamreplay.bench.cause_runner import cause_or_failed, causes_of
from slamreplay.bench.cause_scores import cause_scores, counted
from slamreplay.bench.cause_table import causes_page
from slamreplay.bench.faults import on_sensing
from slamreplay.bench.incidents import ALL_KINDS, KINDS, Incident, story_of
from slamreplay.bench.known_cause import KnownCause, known_cause, things_done
from slamreplay.bench.measure import Measured
from slamreplay.bench.schedule import Case, schedule
from slamreplay.bench.single_causes import SINGLE_CAUSES, on_pitch, on_single
from slamreplay.cli import bench
from slamreplay.cli.main import app
from slamreplay.errors import UsageError
from slamreplay.report.figures.confusion import confusion_figure
from slamreplay.rootcause.calibration import Calibration
from slamreplay.simulate.drive import Carry, Follow, Pause, Slip, drive
from slamreplay.simulate.people import Companion
from slamreplay.simulate.recording import record
from slamreplay.simulate.scenarios import Scenario
from slamreplay.simulate.sensors import WheelErrors, told_truly, wheel_odometry
from slamreplay.simulate.topics import START_NS
from slamreplay.simulate.worlds import warehouse

#: What each kind is known to have been caused by, where it did anything.
DONE = {
    "healthy": [],
    "people": [],
    "wrong_start": ["wrong_initial_pose"],
    "wheel_slip": ["odometry_slip"],
    "push": ["kidnapped"],
    "kidnapped": ["kidnapped"],
    "identical_aisles": ["wrong_initial_pose"],
    "overconfident": ["overconfidence", "odometry_slip"],
    "late_stamps": ["timing"],
    "dropped_scans": ["timing"],
    "boxes_added": ["stale_map_use"],
    "racks_removed": ["stale_map_use"],
    "racks_moved": ["stale_map_use"],
    "half_changed": ["stale_map_use"],
    "map_frame": [],
    "wrong_map": [],
    "vague_start": ["sensing_ambiguity"],
    "escort": ["association_error"],
    "no_matches": ["optimization_drift"],
    "too_sure": ["overconfidence"],
    "clock_off": ["timing"],
    "scans_stop": ["timing"],
}


class FakeTruth:
    """A truth of which only the state is asked, and when the robot got lost."""

    def __init__(self, state, lost_at_s=0.0):
        self.state = state
        self.t_ns = START_NS + np.arange(400) * 100_000_000
        self.lost = np.arange(400) * 0.1 >= lost_at_s


def story(*tour, **fields):
    hall = warehouse()
    tour = tour or (Pause(1.0), Follow(((9.0, 1.2),)), Pause(1.0))
    return Scenario(hall, hall, (1.5, 1.3, 0.0), tour, "", 1, **fields)


def made(kind, told):
    return Incident(kind, 1, record(told))


# --- labels ----------------------------------------------------------------------------------


FAR = (1.9, 7.9, 0.3)
SLIP = Follow(((9.0, 1.2),), slip=Slip(from_m=2.0, duration_s=2.0, grip=0.1))


def story_with(kind):
    """A short story in which the kind's one thing is done as the benchmark does it."""
    if kind in ("wrong_start", "identical_aisles"):
        return story(believed_start=FAR)
    if kind == "wheel_slip":
        return story(Pause(1.0), SLIP)
    if kind in ("push", "kidnapped"):
        return story(Pause(1.0), Carry((3.0, 2.0, 0.4), 2.0))
    plain, rng = story(), np.random.default_rng(3)
    if kind == "vague_start":
        middle = replace(plain, start=(8.0, 6.5, 0.0))
        return on_pitch(middle, 3.4, rng)
    motion = drive(plain.start, plain.tour)
    return on_single(kind, on_sensing(kind, plain, motion, rng), motion, rng)


@pytest.mark.parametrize("kind", sorted(DONE))
def test_every_kind_says_what_was_done(kind):
    told = story_with(kind)
    if kind in ("boxes_added", "racks_removed", "racks_moved", "half_changed"):
        told = replace(told, standing=told.mapped.changed(without=("rack a2",)))
    done = things_done(kind, told, drive(told.start, told.tour))

    assert [d.names[0] for d in done] == DONE[kind]
    assert all(any(getattr(told, k) != v for k, v in d.undone.items()) for d in done)


def test_a_bump_while_driving_is_a_push_and_a_slip():
    told = story(Pause(1.0), SLIP)
    (one,) = things_done("push", told, drive(told.start, told.tour))

    assert one.names == ("kidnapped", "odometry_slip")


def test_a_vague_start_is_told_honestly_and_lies_between_the_aisles():
    told = story_of("vague_start", 4)
    off = np.array(told.believed_start) - np.array(told.start)

    assert np.abs(off[1]) < 3.5 * told.start_sigmas[1]
    assert 3.0 < told.start_sigmas[1] < 4.0
    assert told.lidar.range_max_m <= 4.5
    assert on_pitch(replace(told, start=(1.0, 1.0, 0.0)), 3.5, np.random.default_rng(0)) is None


def test_kinds_of_the_verdicts_benchmark_are_as_they_were():
    assert set(DONE) | {"lost_in_changed"} == set(ALL_KINDS)
    assert (*KINDS, *SINGLE_CAUSES) == ALL_KINDS
    assert not {c.kind for c in schedule()} & set(SINGLE_CAUSES)
    # The bits of a log hang on its kind's place in the list.
    assert [KINDS.index(k) for k in ("healthy", "push", "wrong_map")] == [0, 4, 16]


def test_lost_in_a_changed_hall_has_two_right_answers():
    standing = warehouse().changed(without=("rack a2",))
    one = made("lost_in_changed", replace(story(believed_start=FAR), standing=standing))
    known = known_cause(one, FakeTruth("lost_and_map_changed"))

    assert known.accepted == ("wrong_initial_pose", "stale_map_use")
    assert known.label == "wrong_initial_pose or stale_map_use"


def test_a_cause_is_what_it_would_not_have_happened_without():
    wrong = made("wrong_start", story(believed_start=FAR))
    harmless = made("late_stamps", story(scan_late_s=0.05))

    assert known_cause(wrong, FakeTruth("lost")).accepted == ("wrong_initial_pose",)
    # Lost although nothing that was done loses it: nobody knows why.
    both = made(
        "late_stamps",
        story(scan_late_s=0.05, believed_start=None, start_sigmas=(9.0, 9.0, 3.0)),
    )
    assert known_cause(both, FakeTruth("lost")).label in ("unknown", "timing")
    assert known_cause(harmless, FakeTruth("healthy")) == KnownCause("none", ("none",), ("timing",))


def test_what_had_no_effect_is_no_incident_and_a_wrong_map_always_is_one():
    one = made("map_frame", story(xyyaw_logged_map=(1.0, 0.0, 0.0)))

    assert known_cause(one, FakeTruth("healthy")).accepted == ("wrong_map",)
    calm = known_cause(made("healthy", story()), FakeTruth("healthy"))
    assert (calm.is_incident, calm.label) == (False, "none")
    lost = known_cause(made("healthy", story()), FakeTruth("lost"))
    assert (lost.is_incident, lost.label) == (False, "unknown")


def test_without_its_slip_or_carry_odometry_tells_the_way_that_was_gone():
    slip = Slip(from_m=2.0, duration_s=3.0, grip=0.1, yaw_rate=0.1)
    tour = (
        Pause(1.0),
        Follow(((9.0, 1.2),), slip=slip),
        Carry((9.5, 3.0, 0.4), 2.0),
        Pause(1.0),
    )
    perfect = WheelErrors(0.0, 0.0, 0.0, 0.0, 0.0)
    told = story(*tour, wheels=perfect)
    motion = drive(told.start, told.tour)
    carried, slipped = things_done("kidnapped", told, motion)
    assert (carried.names, slipped.names) == (("kidnapped",), ("odometry_slip",))
    both = (*carried.undone["true_odometry_s"], *slipped.undone["true_odometry_s"])
    raw = wheel_odometry(perfect, motion, 25.0, np.random.default_rng(0))
    told = told_truly(raw, motion, both)

    def end(odometry):  # in the frame of the start
        true = motion.poses_at(odometry.t_s)
        return np.abs(odometry.xyyaw[-1, :2] - (true[-1, :2] - true[0, :2])).max()

    assert end(raw) > 1.0
    assert end(told) < 0.05
    assert end(told_truly(raw, motion, carried.undone["true_odometry_s"])) > 0.5


@pytest.mark.parametrize(
    ("lost_at_s", "label"), [(4.0, "kidnapped"), (1.0, "unknown"), (30.0, "unknown")]
)
def test_a_carry_is_the_cause_where_the_robot_got_lost_by_it(lost_at_s, label):
    told = story(Pause(3.0), Carry((9.5, 3.0, 0.4), 2.0), Pause(3.0))
    one = Incident(
        "kidnapped", 1, SimpleNamespace(scenario=told, motion=drive(told.start, told.tour))
    )

    assert known_cause(one, FakeTruth("lost", lost_at_s)).label == label


def test_an_escort_walks_with_the_robot_and_is_gone_without_it():
    told = story_with("escort")
    motion = drive(told.start, told.tour)
    people = [w for w in told.walkers if isinstance(w, Companion)]
    since, until = people[0].stays_s
    t_s = np.array([since - 1.0, (since + until) / 2.0])
    robot = motion.poses_at(t_s)[:, :2]
    apart = np.hypot(*(people[0].at(t_s) - robot).T)

    assert len(people) >= 10
    assert apart[0] > 1e5
    assert 0.7 < apart[1] < 1.1
    without = things_done("escort", told, motion)[0].undone["walkers"]
    assert not any(isinstance(w, Companion) for w in without)


# --- scores ----------------------------------------------------------------------------------


def log(kind="wheel_slip", seed=1, *, said="odometry_slip", p=0.9, ranked=(), happened="lost",
        accepted=("odometry_slip",), done=None):  # fmt: skip
    answer = {"kind": said, "probability": p, "ranked": [list(r) for r in ranked], "trials": 3,
              "cpu_s": 1.5, "text": "because"}  # fmt: skip
    known = KnownCause(happened, accepted, tuple(done or accepted))
    facts = {
        "state": happened, "judged": happened, "happened": happened, "accepted": list(accepted),
        "done": list(known.done), "label": known.label, "said": {"rules": answer},
    }  # fmt: skip
    return Measured(Case(kind, seed), facts)


def test_a_share_stands_with_wilsons_interval():
    from scipy.stats import binomtest

    for right, of in ((0, 5), (18, 20), (20, 20), (90, 100)):
        oracle = binomtest(right, of).proportion_ci(0.95, "wilson")
        assert counted(right, of) == pytest.approx([right / of, oracle.low, oracle.high])
    assert counted(0, 0) == [None, 0.0, 1.0]


def test_confusion_counts_right_wrong_and_sets_of_right_answers():
    two = ("wrong_initial_pose", "stale_map_use")
    logs = [
        log(),
        log(seed=2),
        log(seed=3, said="kidnapped", ranked=[("kidnapped", 0.6), ("odometry_slip", 0.4)]),
        log("lost_in_changed", accepted=two, said="stale_map_use"),
        log("late_stamps", happened="none", accepted=("none",), done=("timing",), said="timing"),
        log("healthy", happened="none", accepted=("none",), said="kidnapped"),
        log("healthy", happened="lost", accepted=(), said="none"),
        Measured(Case("push", 9), {"error": "oops"}),
    ]
    found = cause_scores(logs, "rules")

    assert (found["incidents"], found["right"]) == (5, 3)  # the failed one is not right
    assert (found["failed"], found["unknown_cause"]) == (1, 1)
    assert found["accuracy"][0] == pytest.approx(0.6)
    assert found["accuracy"][1] < 0.6 < found["accuracy"][2]
    assert found["among_first_two"][0] == pytest.approx(0.8)
    assert found["confusion"] == {
        "odometry_slip": {"odometry_slip": 2, "kidnapped": 1},
        "none": {"timing": 1, "kidnapped": 1},
        "wrong_initial_pose or stale_map_use": {"stale_map_use": 1},
    }
    assert list(found["confusion"])[-1] == "wrong_initial_pose or stale_map_use"
    assert found["by_label"]["odometry_slip"]["share"][0] == pytest.approx(2 / 3)
    assert found["by_kind"]["lost_in_changed"]["logs"] == 1
    assert found["balanced_accuracy"] == pytest.approx((2 / 3 + 1.0) / 2)
    assert found["no_incident"] == {
        "logs": 2, "none": 0, "what_was_put_in": 1, "something_else": 1
    }  # fmt: skip


def test_calibration_of_causes_is_said_against_right():
    honest = [log(seed=i, p=0.75, said="odometry_slip" if i % 4 else "timing") for i in range(40)]
    found = cause_scores(honest, "rules")["calibration"]

    assert found["ece"] == pytest.approx(0.0, abs=1e-12)
    (only,) = found["bins"]
    assert (only["moments"], only["right"]) == (40, pytest.approx(0.75))
    boasting = cause_scores([replace_p(m, 0.99) for m in honest], "rules")["calibration"]
    assert boasting["ece"] == pytest.approx(0.24)


def replace_p(one, p):
    answer = {**one.facts["said"]["rules"], "probability": p}
    return replace(one, facts={**one.facts, "said": {"rules": answer}})


def test_the_page_lists_what_was_named_wrongly_the_surest_first():
    logs = [log(seed=1, said="timing", p=0.3), log(seed=2, said="kidnapped", p=0.8), log(seed=3)]
    page = causes_page(causes_of(logs, 0, "train", ["rules"]))
    wrong = page[page.index("Named wrongly") :]

    assert wrong.index("wheel_slip-2") < wrong.index("wheel_slip-1")
    assert "wheel_slip-3" not in wrong
    assert "| odometry slip |  |  |  |  | 1 | **1** |  | 1 |" in page


def test_the_picture_of_the_matrix_has_a_cell_for_every_count():
    matrix = {"odometry_slip": {"odometry_slip": 7, "kidnapped": 2}, "none": {"timing": 3}}
    figure = confusion_figure(matrix, 7.0)

    assert {t.get_text() for t in figure.axes[0].texts} == {"7", "2", "3"}
    assert confusion_figure({}, 7.0) is None


def test_a_fault_of_ours_is_told_and_counts_as_wrong(monkeypatch):
    from slamreplay.bench import cause_runner

    def broken(*_):
        raise ValueError("oops")

    monkeypatch.setattr(cause_runner, "measured_cause", broken)
    one = cause_or_failed(Case("push", 1), ["rules"])

    assert "oops" in one.facts["error"]
    assert "oops" in causes_page(causes_of([one], 0, "train", ["rules"]))


# --- command ---------------------------------------------------------------------------------


def test_bench_causes_names_draws_and_goes_on_where_it_was(tmp_path, monkeypatch):
    from slamreplay.bench import cause_runner

    if not any(g.name == "bench" for g in app.registered_groups):
        bench.register(app)
    args = ["bench", "causes", "--train", "--logs", "2", "--kind", "wrong_start", "--kind",
            "no_matches", "--jobs", "1", "--by", "rules", "-o", str(tmp_path / "c")]  # fmt: skip
    first = CliRunner().invoke(app, args)
    assert first.exit_code == 0, first.output
    results = json.loads((tmp_path / "c" / "results.json").read_text(encoding="utf-8"))

    assert [c["label"] for c in results["cases"]] == ["wrong_initial_pose", "optimization_drift"]
    assert results["cases"][0]["said"]["rules"]["kind"] == "wrong_initial_pose"
    names = {p.name for p in (tmp_path / "c").iterdir()}
    assert {"results.md", "confusion_rules.svg", "confusion_rules.png"} <= names

    def again(*_):
        raise AssertionError("played twice")

    monkeypatch.setattr(cause_runner, "measured_cause", again)
    second = CliRunner().invoke(app, [*args, "--at-least", "rules.accuracy=1.1"])
    assert second.exit_code == 1
    assert "rules.accuracy" in second.output
    unknown = CliRunner().invoke(app, [*args[:-2], "--by", "nobody", "-o", str(tmp_path / "d")])
    assert isinstance(unknown.exception, UsageError)


def handmade(seed, right, wrong_rule=False):
    """An incident whose right answer has the greater likelihood, and an offset to be learnt."""
    other = "timing" if right == "odometry_slip" else "odometry_slip"
    return Played(
        seed,
        (right,),
        other if wrong_rule else right,
        ((f"{right} x", right, -2.0), (f"{other} x", other, -9.0), ("none", "none", -4.0)),
    )


def test_the_fit_makes_right_answers_likely_and_is_judged_on_what_it_did_not_see():
    cases = [handmade(k, ("odometry_slip", "timing")[k % 2], k % 5 == 0) for k in range(20)]

    record = record_of(cases)
    weights = Calibration(record["slope"], record["bias"], record["rule"])

    assert record["cross_validated"]["right"] == 20
    assert record["cross_validated"]["interval"][0] > 0.8
    assert all(said(weights, case)[0] in case.accepted for case in cases)
    assert said(weights, cases[1])[1] > said(Calibration(0.0), cases[1])[1] + 0.3
    assert record == record_of(cases)
