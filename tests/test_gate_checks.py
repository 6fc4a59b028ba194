"""A post-mortem against the rules of a gate: what passes, what fails, what cannot be assessed."""

from dataclasses import replace

import numpy as np
import pytest
from posts import S, bare_post, lost_post

from slamreplay.bundle.findings import Finding
from slamreplay.bundle.run import Estimate, Innovations
from slamreplay.gate.gated import checked, gated, unread
from slamreplay.gate.limit_checks import limited
from slamreplay.gate.measures import Measure, Measures, Series
from slamreplay.gate.measuring import measures_of
from slamreplay.gate.outcome import GateResult
from slamreplay.gate.rules import Demands, Limit, Rules
from slamreplay.rootcause.result import Candidate, RootCause
from slamreplay.verdict.judgement import FailureMode, Interval

NONE = Rules(max_severity=None)


@pytest.fixture(scope="module")
def post():
    return lost_post()


@pytest.fixture(scope="module")
def bare(post):
    return bare_post(post)


def of(post, rules, **how):
    """Outcomes by check."""
    told = checked(rules, post, measures_of(post), **how)
    assert len({one.check for one in told}) == len(told)
    return {one.check: one for one in told}


def statuses(post, rules, **how):
    return {check: one.status for check, one in of(post, rules, **how).items()}


def test_what_is_expected_must_be_found(post):
    findings = ("SR-LOC-001", "SR-LOC-*", "SR-MAP-001")
    states = ("state=lost", "state=healthy", "state=lost*", "failure_mode=kidnapped")
    rules = replace(NONE, expect=(*findings, *states))
    told = of(post, rules)

    assert {check: one.status for check, one in told.items()} == {
        "expect/SR-LOC-001": "passed",
        "expect/SR-LOC-*": "passed",
        "expect/SR-MAP-001": "failed",
        "expect/state=lost": "passed",
        "expect/state=healthy": "failed",
        "expect/failure_mode=kidnapped": "passed",
        "expect/state=lost*": "passed",
    }
    found = told["expect/SR-LOC-001"]
    assert (found.message, found.value, found.unit) == ("off by 1.5 m", 1.5, "m")
    assert found.end_ns - found.start_ns == 10 * S
    assert told["expect/state=healthy"].message == "lost: The robot was lost for 10 s."
    assert "lost" in told["expect/SR-MAP-001"].message


def test_what_is_forbidden_must_not(post):
    rules = replace(NONE, forbid=("SR-LOC-*", "SR-DAT-002", "OTHER-*", "state=lost",
                                  "failure_mode=timing"))  # fmt: skip
    told = of(post, rules)
    failed = {check for check, one in told.items() if one.status == "failed"}

    assert failed == {"forbid/SR-LOC-001", "forbid/SR-DAT-002", "forbid/OTHER-7",
                      "forbid/state=lost"}  # fmt: skip
    assert {f"forbid/SR-LOC-00{k}" for k in (2, 3, 4)} <= set(told)  # each is a check of its own
    assert told["forbid/failure_mode=timing"].status == "passed"
    assert told["forbid/SR-LOC-001"].severity == "error"
    assert told["forbid/OTHER-7"].severity == "warning"  # nobody looks at a failure that is an info


def test_what_is_expected_by_name_is_not_forbidden_by_a_pattern(post):
    told = statuses(post, replace(NONE, expect=("SR-LOC-001",), forbid=("SR-LOC-*", "SR-*")))

    assert "forbid/SR-LOC-001" not in told
    assert told["forbid/SR-DAT-002"] == "failed"


def test_severity_counts_what_nobody_expects(post):
    worst = replace(NONE, max_severity="warning")

    told = of(post, worst)["severity"]
    assert (told.status, told.severity) == ("failed", "error")
    assert "1 finding worse than warning: SR-LOC-001 off by 1.5 m" in told.message
    assert told.start_ns == post.findings[0].start_ns
    assert statuses(post, replace(worst, expect=("SR-LOC-001",)))["severity"] == "passed"
    # An expected state excuses the findings that made it, and no others.
    lost = replace(worst, expect=("state=lost",))
    assert statuses(post, lost)["severity"] == "passed"
    assert statuses(post, replace(lost, max_severity="info"))["severity"] == "failed"
    worse = replace(post, findings=(*post.findings, Finding("SR-CON-010", "error", "collapsed")))
    assert statuses(worse, lost)["severity"] == "failed"
    assert "severity" not in statuses(worse, NONE)


def test_silence_about_what_cannot_be_looked_for_is_no_pass(bare):
    rules = Rules(
        expect=("SR-MAP-001", "failure_mode=kidnapped", "root_cause=kidnapped"),
        forbid=("SR-LOC-001", "SR-CON-010", "SR-ODO-002", "SR-CON-006", "state=lost"),
        limits=(Limit("error_max_m", 0.5), Limit("error_m", 0.5), Limit("sigma_max_m", 1.0)),
    )
    told = of(bare, rules)

    assert {one.status for one in told.values()} == {"skipped"}
    assert told["limit/error_m"].message == "no map"
    assert "no belief to judge" in told["forbid/SR-LOC-001"].message
    assert "no odometry" in told["forbid/SR-ODO-002"].message


def test_what_was_found_all_the_same_was_found(bare):
    found = replace(bare, findings=(Finding("SR-CON-010", "error", "collapsed"),))
    rules = replace(NONE, expect=("SR-CON-010", "SR-CON-01*"), forbid=("SR-CON-010", "SR-CON-011"))

    assert [*statuses(found, rules).values()] == ["passed", "passed", "failed", "skipped"]


def test_a_belief_without_a_second_source_cannot_be_held_against_one(post):
    told = of(post, replace(NONE, forbid=("SR-CON-004", "SR-CON-005")))

    assert not post.consistency
    assert {one.status for one in told.values()} == {"skipped"}
    assert "nothing to hold the belief's errors against" in told["forbid/SR-CON-004"].message


def test_innovations_can_be_looked_at_where_an_estimator_gave_some(post):
    """Dead reckoning and a particle filter predict no measurement; only the latter ranks scans."""
    rules = replace(NONE, forbid=("SR-CON-006", "SR-CON-007", "SR-CON-008", "SR-CON-009"))
    (amcl, *_), track = post.trials, post.hindsight.track
    one = Innovations("scan", track.t_ns[:1], np.ones((1, 1)), np.ones((1, 1, 1)), np.ones(1, bool))
    for_a_ledger = replace(one, is_predicted=False)
    kept = replace(amcl, run=replace(amcl.run, estimate=Estimate(track, (for_a_ledger,))))
    predicts = replace(amcl, run=replace(amcl.run, estimate=Estimate(track, (for_a_ledger, one))))
    ranks = {"likelihood_quantile": np.ones(len(track))}
    tells = replace(amcl, run=replace(amcl.run, estimate=Estimate(track, diagnostics=ranks)))

    def status(*trials):
        return [*statuses(replace(post, trials=trials), rules).values()]

    assert status(*post.trials) == status(kept) == ["skipped"] * 4
    assert status(predicts) == ["passed"] * 3 + ["skipped"]
    assert status(tells) == ["skipped"] * 3 + ["passed"]


def test_an_expected_state_excuses_nothing_of_other_stretches(post):
    lost = post.judgement.intervals[-1]
    half = (lost.start_ns + lost.end_ns) // 2
    changed = Interval("map_changed", half, lost.end_ns, findings=("SR-MAP-001",))
    intervals = (*post.judgement.intervals[:-1], replace(lost, end_ns=half), changed)
    both = replace(
        post,
        judgement=replace(post.judgement, intervals=intervals),
        findings=(*post.findings, Finding("SR-MAP-001", "error", "an aisle changed")),
    )
    told = of(both, Rules(expect=("state=lost",), max_severity="warning"))["severity"]

    assert told.status == "failed"
    assert told.message == "1 finding worse than warning: SR-MAP-001 an aisle changed"


def test_who_expects_a_state_is_told_of_a_log_that_cannot_be_judged(bare):
    """Else a log that lost its map would go through as a healthy one."""
    told = statuses(bare, replace(NONE, expect=("state=healthy", "state=insufficient_data")))

    assert told == {
        "expect/state=healthy": "failed",
        "expect/state=insufficient_data": "passed",
    }


def test_a_log_of_which_nothing_can_be_assessed_fails(post, bare):
    rules = Rules(forbid=("SR-LOC-001",), limits=(Limit("error_max_m", 0.5),))
    log = gated(bare, Demands("Is it?", rules), "a.mcap")

    assert [o.status for o in log.outcomes] == ["skipped", "skipped", "skipped", "failed"]
    assert log.outcomes[-1].check == "assessable"
    assert log.status == "failed"
    waived = gated(bare, Demands("Is it?", replace(rules, require_assessable=False)), "a.mcap")
    assert waived.status == "skipped"
    assert gated(post, Demands("Is it?", NONE), "a.mcap").outcomes == ()


def test_root_causes_are_skipped_where_nobody_looked(post):
    rules = replace(NONE, expect=("root_cause=kidnapped",), forbid=("root_cause=timing",))
    candidate = Candidate("kidnapped", "x", 1.0, "m", 0, -1.0, 0.9, "carried by 1 m")
    began = RootCause(0, S, "kidnapped", 0.9, (candidate,), 3)

    assert set(statuses(post, rules, cause=False).values()) == {"skipped"}
    assert statuses(replace(post, root_cause=began), rules) == {
        "expect/root_cause=kidnapped": "passed",
        "forbid/root_cause=timing": "passed",
    }
    untried = replace(began, candidates=(), reason="no laser")
    assert of(replace(post, root_cause=untried), rules)[
        "expect/root_cause=kidnapped"
    ].message == "no laser"  # fmt: skip


def test_a_log_that_is_undecided_may_still_tell_how_it_failed(bare):
    mode = FailureMode("wrong_map", 0.7, ("no place fits",))
    wrong = replace(bare, judgement=replace(bare.judgement, failure_mode=mode))
    rules = replace(NONE, expect=("failure_mode=wrong_map",), forbid=("failure_mode=wrong_map",))

    assert [*statuses(wrong, rules).values()] == ["passed", "failed"]


def numbers(**values):
    return Measures(
        0, 20 * S, {name: Measure(value, "m", 0.1, 0.9, 20.0) for name, value in values.items()}
    )


def limit_of(measures, *limits, before=()):
    return [*limited(limits, measures, before)]


def test_a_number_is_held_against_its_limit():
    measures = numbers(error_max_m=0.6, hindsight_coverage=0.6)
    above, below, both = limit_of(
        measures,
        Limit("error_max_m", 0.5),
        Limit("hindsight_coverage", None, 0.9),
        Limit("error_max_m", 0.7, 0.2),
    )

    assert (above.status, above.value, above.limit, above.unit) == ("failed", 0.6, 0.5, "m")
    assert above.message == "0.6 m (95 % interval 0.1 to 0.9), above 0.5 m"
    assert above.title == "error_max_m at most 0.5"
    assert (below.status, below.limit) == ("failed", 0.9)
    assert "below 0.9" in below.message
    assert (both.check, both.status) == ("limit/error_max_m/2", "passed")
    assert [one.status for one in limit_of(measures, Limit("error_max_m", 0.6))] == ["passed"]


@pytest.mark.parametrize(("value", "failed"), [(0.35, False), (0.4, False), (0.45, True)])
def test_from_run_to_run_a_failure_holds_until_it_is_clear(value, failed):
    """By the failures of the baseline: a number that dances about its limit is no coin toss."""
    limit = Limit("error_max_m", 0.5, None, 0.4)
    (fresh,) = limit_of(numbers(error_max_m=value), limit)
    (again,) = limit_of(numbers(error_max_m=value), limit, before=("limit/error_max_m",))

    assert fresh.status == "passed"
    assert (again.status == "failed") is failed
    if failed:
        assert again.limit == 0.4
        assert "it failed before" in again.message


def test_of_a_number_over_time_the_worst_stretch_is_shown():
    t = np.arange(200) * (S // 10) + 5 * S
    values = np.full(200, 0.1)
    values[20:40], values[60:100], values[150:160] = 0.7, 0.9, 1.5
    measures = Measures(5 * S, 25 * S, {}, {"error_m": Series(t, values, "m")})
    lasting, most, least = limit_of(
        measures,
        Limit("error_m", 0.5, for_s=1.5),
        Limit("error_m", 2.0),
        Limit("error_m", None, 0.05),
    )

    assert (lasting.status, lasting.value, lasting.limit) == ("failed", 0.9, 0.5)
    assert (lasting.start_ns - 5 * S, lasting.end_ns - 5 * S) == (6 * S, 10 * S)
    assert lasting.message == (
        "above 0.5 m for 6.0 s in 2 stretches, the worst from 6.0 to 10.0 s, up to 0.9 m"
    )
    assert lasting.title == "error_m at most 0.5 but for less than 1.5 s"
    assert (most.check, most.status, most.value) == ("limit/error_m/2", "passed", 1.5)
    assert (least.status, least.value) == ("passed", 0.1)
    (never,) = limit_of(measures, Limit("error_m", 1.0, for_s=2.0))
    assert (never.status, never.message) == (
        "passed",
        "greatest 1.5 m, beyond 1 m never for 2 s",
    )


def test_an_estimator_without_a_pose_fails_every_limit():
    measures = Measures(0, S, {"amcl.error_max_m": Measure(np.inf, "m")})
    (told,) = limit_of(measures, Limit("amcl.error_max_m", 1e9))

    assert (told.status, told.value) == ("failed", None)
    assert "without a single pose" in told.message


def test_exit_codes_follow_the_worst_log(post, bare):
    good = gated(post, Demands("Is it?", replace(NONE, expect=("state=lost",))), "a")
    bad = gated(post, Demands("Is it?", replace(NONE, expect=("state=healthy",))), "b")
    gone = unread("c", "no such file")

    def code(*logs):
        return GateResult("Is it?", "gate.yaml", logs).exit_code

    assert (code(good), code(good, bad), code(bad, gone, good)) == (0, 1, 2)
    assert (gone.state, gone.status, gone.summary) == (None, "error", "no such file")
