"""Logs that failed, when trouble begins, and who was lost beside an area."""

import pytest
from fleet_tables import AGED_AISLE, AISLE_M, BOX_ROWS, fleet

from slamreplay.fleet.answering import answers as answers_of
from slamreplay.fleet.answers import NEAR_M


@pytest.fixture(scope="module")
def made():
    return fleet(seed=3)


@pytest.fixture(scope="module")
def answers(made, tmp_path_factory):
    return answers_of(made.write(tmp_path_factory.mktemp("fleet")))


def test_trouble_begins_with_the_first_interval_that_is_lost_or_changed(made, answers):
    logs = {row["key"]: row for row in made.tables["logs"].to_pylist()}
    troubled = {"lost", "map_changed", "lost_and_map_changed"}
    first = {}
    for row in made.tables["intervals"].to_pylist():
        if row["state"] in troubled:
            after = row["start_ns"] - logs[row["key"]]["start_ns"]
            first[row["key"]] = min(after, first.get(row["key"], after)) / 1e9

    assert first
    assert answers.troubles_s == pytest.approx(first)


def test_failed_logs_are_told_with_their_lines_by_site(made, answers):
    failed = [row for row in made.tables["logs"].to_pylist() if row["status"] == "failed"]

    assert [(one.site, one.log) for one in answers.failures] == sorted(
        (row["site"], row["log"]) for row in failed
    )
    assert {one.error for one in answers.failures} == {row["error"] for row in failed}


def test_who_was_lost_beside_an_area_is_counted(made, answers):
    (area,) = (one for one in answers.areas if one.advice == "re-map")
    site = {row["key"]: row["site"] for row in made.tables["logs"].to_pylist()}
    near = {
        row["key"]
        for row in made.tables["places"].to_pylist()
        if row["lost_s"] > 0
        and site[row["key"]] == "north"
        and area.box_m[0] - NEAR_M <= row["col"] < area.box_m[2] + NEAR_M
        and area.box_m[1] - NEAR_M <= row["row"] < area.box_m[3] + NEAR_M
    }

    assert area.box_m[0] >= AGED_AISLE * AISLE_M
    assert area.box_m[1] <= BOX_ROWS[0]
    assert 0 < len(near) == area.lost_near
