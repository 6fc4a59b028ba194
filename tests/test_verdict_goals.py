"""Recoveries told of by several sources are one, and goals come from whoever tells them best."""

import numpy as np
import pytest
from handmade import at_scans, hindsight_of
from hypothesis import given, settings
from hypothesis import strategies as st

from slamreplay.bundle.belief import recorded_belief
from slamreplay.bundle.recoveries import kind_of_recovery, tells_of_every_recovery
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.geometry.times import ns
from slamreplay.testing.synthetic import START_NS, synthetic_bundle
from slamreplay.verdict.actions import actions, risky
from slamreplay.verdict.goals import aborted, navigations, recoveries
from slamreplay.verdict.judge import judge
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.motion import protections

BUNDLE = synthetic_bundle()


def view_of(*rows, bundle=None):
    """A view with rows of seconds, name, status, source and, if need be, goal and topic."""
    bundle = bundle or BUNDLE
    whole = [(*r, *("", "/topic")[len(r) - 4 :]) for r in rows]
    t_s, name, status, source, goal, topic = zip(*whole, strict=True)
    t = START_NS + np.array([ns(s) for s in t_s], dtype=np.int64)
    columns = {"topic": topic, "name": name, "status": status, "goal": goal, "source": source}
    times = {"t_ns": t, "t_sensor_ns": t, "t_log_ns": t}
    table = Table(TABLES["recoveries"], {**times, **{k: list(v) for k, v in columns.items()}})
    return bundle.view().with_table(table)


def seconds(times):
    return [round((t - START_NS) / 1e9, 3) for t in times]


def found(*rows):
    begun = recoveries(view_of(*rows))
    return list(zip(seconds(r.t_ns for r in begun), [r.name for r in begun], strict=True))


def test_kinds_of_recoveries():
    names = [
        "ClearLocalCostmap-Context", "Spin", "rotate_recovery", "back_up", "BackUp", "Wait",
        "clear_entirely_local_costmap", "conservative_reset", "DriveOnHeading", "Dislodge",
    ]  # fmt: skip

    assert [kind_of_recovery(name) for name in names] == [
        "clear", "spin", "spin", "backup", "backup", "wait", "clear", "clear", "drive", "",
    ]  # fmt: skip
    assert tells_of_every_recovery("nav2_msgs/msg/BehaviorTreeLog")
    assert not tells_of_every_recovery("action_msgs/msg/GoalStatusArray")


def test_one_recovery_that_everybody_tells_of_is_one():
    assert found(
        (4.0, "Spin", "running", "behavior_tree"),
        (4.01, "spin", "accepted", "action", "a"),
        (4.02, "spin", "executing", "action", "a"),
        (4.05, "Running", "running", "log"),
        (4.1, "recovery 1", "running", "navigation_feedback"),
        (9.0, "spin", "succeeded", "action", "a"),
        (9.1, "BackUp", "running", "behavior_tree"),
        (9.2, "recovery 2", "running", "navigation_feedback"),
    ) == [(4.0, "Spin"), (9.1, "BackUp")]


def test_a_goal_that_waits_for_its_turn_is_one_recovery_with_its_best_name():
    assert found(
        (1.0, "recovery", "active", "action", "x"),
        (1.0, "rotate", "pending", "action", "x"),
        (9.0, "recovery", "active", "action", "x"),
        (12.0, "recovery", "preempting", "action", "x"),
        (15.0, "spin", "canceling", "action", "y"),
    ) == [(1.0, "rotate")]


def test_recoveries_of_one_source_are_not_merged_by_kind():
    assert found(
        (1.0, "ClearLocalCostmap-Context", "running", "behavior_tree"),
        (1.1, "ClearGlobalCostmap-Context", "running", "behavior_tree"),
        (1.2, "Spin", "running", "behavior_tree"),
    ) == [
        (1.0, "ClearLocalCostmap-Context"), (1.1, "ClearGlobalCostmap-Context"), (1.2, "Spin"),
    ]  # fmt: skip


def test_each_count_is_a_recovery_of_its_own():
    counts = enumerate((1.0, 1.0, 1.5), start=1)
    rows = [(t, f"recovery {n}", "running", "navigation_feedback") for n, t in counts]

    assert [t for t, _ in found(*rows)] == [1.0, 1.0, 1.5]


@settings(deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(0, 20), st.sampled_from(["Spin", "BackUp", "Wait"])), min_size=1,
        max_size=6,
    )
)  # fmt: skip
def test_a_second_witness_of_every_recovery_adds_none(told):
    rows = [(t, name, "running", "behavior_tree") for t, name in told]
    echoes = [(t + 0.05, name.lower(), "running", "log") for t, name in told]

    assert found(*rows) == found(*rows, *echoes)


# --- goals ----------------------------------------------------------------------------------

STATUS = "/navigate_to_pose/_action/status"


def spans(*rows):
    active = navigations(view_of(*rows))
    return None if active is None else [tuple(seconds((s.start_ns, s.end_ns))) for s in active]


def test_goals_of_an_action_each_from_its_begin_to_its_end():
    rows = [
        (1.0, "navigate_to_pose", "executing", "action", "a", STATUS),
        (3.0, "navigate_to_pose", "accepted", "action", "b", STATUS),
        (3.1, "navigate_to_pose", "preempted", "action", "a", STATUS),
        (8.0, "navigate_to_pose", "aborted", "action", "b", STATUS),
        (8.1, "NavigateRecovery", "failure", "behavior_tree"),
    ]

    assert spans(*rows) == [(1.0, 3.1), (3.0, 8.0)]
    assert seconds(aborted(view_of(*rows))) == [8.0, 8.1]


def test_a_goal_lasts_to_the_end_where_its_end_would_have_been_told():
    status = (5.0, "navigate_to_pose", "executing", "action", "a", STATUS)
    feedback = (5.0, "move_base", "active", "action", "a", "/move_base/feedback")
    result = (9.0, "move_base", "succeeded", "action", "a", "/move_base/result")

    assert [start for start, _ in spans(status)] == [5.0]
    assert spans(status)[0][1] > 15.0
    assert spans(feedback) is None
    assert spans(feedback, result) == [(5.0, 9.0)]
    assert spans(result) == []


def test_log_lines_tell_of_goals_where_nobody_else_does():
    rows = [
        (1.0, "navigate_to_pose", "running", "log"),
        (6.0, "navigate_to_pose", "failed", "log"),
    ]
    tree = (2.0, "NavigateRecovery", "running", "behavior_tree")
    ended = (7.0, "NavigateRecovery", "success", "behavior_tree")

    assert spans(*rows) == [(1.0, 6.0)]
    assert spans(*rows, tree, ended) == [(2.0, 7.0)]
    assert seconds(aborted(view_of(*rows))) == [6.0]
    assert found(*rows) == []


# --- inferred -------------------------------------------------------------------------------


def test_an_inferred_recovery_is_shown_as_one_and_nothing_rests_on_it():
    bundle = synthetic_bundle()
    told = view_of((4.0, "Spin", "running", "behavior_tree"), bundle=bundle)
    guessed = view_of((4.0, "spin", "running", "inferred"), bundle=bundle)
    belief = recorded_belief(told, at_scans(bundle))
    sure, unsure = (judge(v, belief, hindsight_of(bundle)) for v in (told, guessed))

    assert [(a.name, a.inferred, a.needless) for a in sure.actions] == [("Spin", False, True)]
    assert [(a.name, a.inferred, a.needless) for a in unsure.actions] == [("spin", True, None)]
    assert "SR-ACT-005" in [f.id for f in sure.findings]
    assert not [f.id for f in unsure.findings if f.id.startswith("SR-ACT")]


def test_an_inferred_recovery_is_not_counted_as_blocked():
    bundle = synthetic_bundle()
    view = view_of((4.0, "spin", "running", "inferred"), bundle=bundle)
    belief = recorded_belief(view, at_scans(bundle))
    vague = type(belief)("map", "base_link", belief.t_ns, belief.xyyaw, belief.cov * 1000)
    (action,) = actions(view, vague, Limits())

    assert action.allowed is False
    assert risky((action,)) == ()


def test_an_inferred_recovery_is_no_witness_of_a_stop():
    from test_verdict import standing

    from slamreplay.verdict.stops import stops

    view = standing(synthetic_bundle(seconds=30), 10.0, 16.0)
    for source, count in (("inferred", 0), ("behavior_tree", 1)):
        table = view_of((12.0, "spin", "running", source)).table("recoveries")
        assert len(stops(view.with_table(table), None, None, ())) == count


@pytest.mark.parametrize(
    ("message", "is_stop"),
    [
        ("collision monitor: stop by polygon front", True),
        ("collision monitor: slowdown by polygon front", False),
        ("collision monitor: released", False),
    ],
)
def test_a_collision_monitors_stop_is_a_protective_one(message, is_stop):
    t = np.array([START_NS])
    times = dict.fromkeys(("t_ns", "t_sensor_ns", "t_log_ns"), t)
    columns = {"topic": ["/c"], "level": [1], "name": ["collision_monitor"], "message": [message]}
    view = synthetic_bundle().view().with_table(Table(TABLES["health"], {**times, **columns}))

    assert (protections(view, START_NS, START_NS) is not None) == is_stop
