"""A log without one part of the replay bundle: what ingest makes of it, and which answers go."""

import pytest

from slamreplay.bundle.schema import PARTS
from slamreplay.labs.minimum_replay.pages import Row, results
from slamreplay.labs.minimum_replay.parts import recorded
from slamreplay.labs.minimum_replay.questions import NONE, QUESTIONS, Answer
from slamreplay.postmortem import postmortem
from slamreplay.simulate.bundled import bundle_of
from slamreplay.simulate.drive import Follow, Pause
from slamreplay.simulate.recording import record
from slamreplay.simulate.scenarios import Scenario
from slamreplay.simulate.worlds import warehouse


@pytest.fixture(scope="module")
def drive():
    hall = warehouse()
    tour = (Pause(0.5), Follow(((4.0, 1.2),)), Pause(0.3, "Wait"), Follow(((5.5, 1.2),)))
    return record(Scenario(hall, hall, (1.5, 1.3, 0.0), tour, "healthy", 1))


@pytest.mark.parametrize("part", [p for p in PARTS if p not in ("pose", "covariance")])
def test_ingest_misses_the_part_that_was_not_recorded(drive, part):
    assert bundle_of(drive, edit=recorded(part)).manifest.missing_parts() == [part]


def test_with_all_parts_nothing_is_missing_and_no_truth_is_in_it(drive):
    bundle = bundle_of(drive, edit=recorded(None))

    assert bundle.manifest.missing_parts() == []
    assert bundle.manifest.topic_of("reference") is None


def test_without_a_pose_there_is_no_covariance_either_and_nobody_is_called_not_lost(drive):
    bundle = bundle_of(drive, edit=recorded("pose"))
    found = postmortem(bundle)

    assert bundle.manifest.missing_parts() == ["pose", "covariance"]
    assert "not lost" not in found.judgement.summary
    assert QUESTIONS["lost or changed"](found, drive).text == "map right; lost?"
    assert not QUESTIONS["error of the belief"](found, drive).known


def test_a_covariance_of_zeros_leaves_pose_and_verdict(drive):
    found = postmortem(bundle_of(drive, edit=recorded("covariance")))

    assert found.judgement.state == "healthy"
    assert not QUESTIONS["its NEES"](found, drive).known
    assert not QUESTIONS["motions allowed, clearance"](found, drive).known


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        (Answer("a", (1.0,)), Answer("b", (1.09,)), True),
        (Answer("a", (1.0,)), Answer("a", (1.2,)), False),
        (Answer("lost", words="lost"), Answer("lost", words="changed"), False),
        (Answer("a", (1.0,)), Answer("a", (1.0, 2.0)), False),
        (NONE, NONE, True),
        (NONE, Answer("a"), False),
    ],
)
def test_answers_are_the_same_to_a_tenth(one, other, same):
    assert one.is_same(other) is other.is_same(one) is same


def test_what_became_of_each_answer_is_told():
    whole = dict.fromkeys(QUESTIONS, Answer("1 m", (1.0,)))
    without = whole | {"how it began": NONE, "where it was": Answer("2 m", (2.0,))}
    rows = [Row("lost_robot", None, whole, ()), Row("lost_robot", "map", without, ("map",))]

    found = results(rows, {"lost_robot": "lost"})
    became = found.numbers["logs"]["lost_robot"]["without"]["map"]["became"]

    assert became.pop("how it began") == "none"
    assert became.pop("where it was") == "other"
    assert set(became.values()) == {"same"}
    assert found.tables[0].rows[1][2] == ""
