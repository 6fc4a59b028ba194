"""Answers of a fleet, held against DuckDB's on the same folder and cases worked by hand."""

import math
from datetime import date

import duckdb
import numpy as np
import pytest
from fleet_rows import (
    DAY0,
    HOUR,
    commit_fleet,
    failed_row,
    log_row,
    place_row,
    random_fleet,
    tables,
)

from slamreplay.fleet import cells, snapshot
from slamreplay.fleet.answering import answers
from slamreplay.fleet.answers import DIMENSIONS
from slamreplay.fleet.areas import worth
from slamreplay.fleet.intervals import garwood, newcombe, z_of
from slamreplay.fleet.queries import queries, queries_sql, views
from slamreplay.fleet.store import commit, compact
from slamreplay.verdict.judgement import STATES


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    """A folder of a fleet and its answers."""
    folder = tmp_path_factory.mktemp("fleet")
    commit_fleet(folder, random_fleet(1, 240))
    return folder, answers(folder)


@pytest.fixture(scope="module")
def asked(fleet):
    """What DuckDB answers, by query: rows as dicts."""
    folder, _ = fleet
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        with duckdb.connect() as connection:
            connection.execute(views())
            return {q.name: _dicts(connection.execute(q.sql)) for q in queries()}


def _dicts(result):
    names = [column[0] for column in result.description]
    return [dict(zip(names, row, strict=True)) for row in result.fetchall()]


def _same(value, other):
    if isinstance(value, float) or isinstance(other, float):
        if value is None or other is None or math.isnan(value):
            return value is other or (value is not None and math.isnan(value) and other is None)
        return value == pytest.approx(other, rel=1e-9, abs=1e-9)
    return value == other


def _agree(rows, others):
    assert len(rows) == len(others)
    for row, other in zip(rows, others, strict=True):
        wrong = {k: (v, other[k]) for k, v in row.items() if not _same(v, other[k])}
        assert not wrong, (row, wrong)


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_verdicts_are_counted_as_duckdb_counts_them(fleet, asked, dimension):
    rows = [
        {
            "name": group.name, "logs": group.logs, "failed": group.failed, **group.states,
            "robots": group.robots, "sites": group.sites, "judged_h": group.judged_h,
            "driven_km": group.driven_km, "lost_h": group.lost_h, "changed_h": group.changed_h,
            "lost_times": group.lost_per_km.events, "lost_per_km": group.lost_per_km.value,
            "lost_per_h": group.lost_per_h.value, "stops": group.stops,
            "first_day": group.first_day, "last_day": group.last_day,
            "lost_logs": group.lost.count, "judged_logs": group.lost.n,
            "lost_low": group.lost.low, "lost_high": group.lost.high,
            "changed_logs": group.changed.count, "changed_low": group.changed.low,
            "changed_high": group.changed.high, "gate_failed": group.gate_failed.count,
            "gated_logs": group.gate_failed.n, "gate_low": group.gate_failed.low,
            "gate_high": group.gate_failed.high,
        }
        for group in fleet[1].by[dimension]
    ]  # fmt: skip
    others = asked[f"verdicts_by_{dimension}"]
    if dimension == "day":
        others = [{**row, "name": row["name"] and str(row["name"])} for row in others]
    assert len(rows) > 2
    _agree(rows, others)


def test_causes_are_ranked_as_duckdb_ranks_them(fleet, asked):
    assert len(fleet[1].causes) > 1
    _agree([vars(cause) for cause in fleet[1].causes], asked["causes"])


def test_spots_are_those_of_duckdb(fleet, asked):
    rows = [
        {
            **_told(spot, "site", "map_version", "here_s", "lost_s", "entered", "robots"),
            **_box(spot), "passed": spot.lost.n, "lost_logs": spot.lost.count,
            "low": spot.lost.low, "high": spot.lost.high, "example": spot.example,
        }
        for spot in fleet[1].spots
    ]  # fmt: skip
    assert len(rows) > 2
    _agree(rows, asked["spots"])


def test_areas_are_those_of_duckdb(fleet, asked):
    names = (
        "site", "map_version", "m2", "kind", "logs", "robots", "first_day", "last_day", "visits",
        "still", "latest", "near_h", "lost_near_s", "lost_near", "in_use", "advice", "persistence",
        "example",
    )  # fmt: skip
    found = fleet[1].areas
    rows = [{**_told(area, *names), **_box(area), "worth": worth(area)} for area in found]
    assert {area.advice for area in found} == {"re-map", "watch", "temporary"}
    _agree(rows, asked["areas"])


def test_picks_are_those_of_duckdb(fleet, asked):
    names = ("key", "log", "report", "site", "robot", "day", "state", "kind", "alike")
    assert len({pick.kind for pick in fleet[1].picks}) > 4
    _agree([_told(pick, *names) for pick in fleet[1].picks], asked["picks"])


def test_steps_are_those_of_duckdb(fleet, asked):
    rows = [
        {
            **_told(step, "before", "after", "measure", "low", "high"),
            **_told(step, "sites", "robots", "verdict"),
            "was_count": step.was.count, "was_logs": step.was.n, "was": step.was.value,
            "now_count": step.now.count, "now_logs": step.now.n, "now": step.now.value,
        }
        for step in fleet[1].steps
    ]  # fmt: skip
    assert len(rows) > 10
    _agree(rows, asked["steps"])


def test_places_of_maps_are_those_of_duckdb(fleet, asked):
    names = ("here_s", "lost_s", "entered", "passed", "lost_logs", "seen_m2", "looks", "against")
    rows = sorted(
        (
            {
                "site": one.site, "map_version": one.map_version, "col": int(one.col[k]),
                "row": int(one.row[k]), **{name: getattr(one, name)[k].item() for name in names},
            }
            for one in fleet[1].maps
            for k in range(len(one.col))
        ),
        key=lambda row: (row["site"] or "", row["map_version"], row["col"], row["row"]),
    )  # fmt: skip
    _agree(rows, asked["maps"])


def test_failures_are_those_of_duckdb(fleet, asked):
    assert len(fleet[1].failures) > 5
    _agree([vars(one) for one in fleet[1].failures], asked["failures"])


def _told(answer, *names):
    return {name: getattr(answer, name) for name in names}


def _box(answer):
    return dict(zip(("x_min_m", "y_min_m", "x_max_m", "y_max_m"), answer.box_m, strict=True))


def test_the_printed_file_runs_as_a_whole(fleet, monkeypatch):
    folder, _ = fleet
    monkeypatch.chdir(folder)
    text = queries_sql(folder)
    assert "$" not in text
    with duckdb.connect() as connection:
        assert connection.execute(text).fetchall() is not None


def test_answers_do_not_depend_on_how_rows_came_into_parts(tmp_path):
    rows = random_fleet(1, 240)
    for row in rows["logs"]:  # of two under one name the newest counts
        row["log"] = f"{row['key']}.mcap"
    for name, parts in (("one", 7), ("two", 3)):
        commit_fleet(tmp_path / name, rows, parts)
    compact(tmp_path / "two")
    one, two = (answers(tmp_path / name) for name in ("one", "two"))
    for name in ("total", "by", "causes", "spots", "areas", "picks", "steps", "copies", "failures"):
        assert getattr(one, name) == getattr(two, name), name
    for a, b in zip(one.maps, two.maps, strict=True):
        assert all(np.array_equal(v, getattr(b, k))
                   if isinstance(v, np.ndarray) else v == getattr(b, k)
                   for k, v in vars(a).items())  # fmt: skip


def test_answers_do_not_depend_on_how_many_rows_are_read_at_once(fleet, monkeypatch):
    folder, found = fleet
    monkeypatch.setattr(snapshot, "ROWS", 64)  # places of a log come in two reads
    monkeypatch.setattr(cells, "_MERGE_AT", 16)
    again = answers(folder)

    assert (again.spots, again.areas, again.picks) == (found.spots, found.areas, found.picks)
    for a, b in zip(again.maps, found.maps, strict=True):
        np.testing.assert_array_equal(a.passed, b.passed)
        np.testing.assert_array_equal(a.seen_m2, b.seen_m2)


def test_a_fleet_without_logs_has_answers_about_nothing(tmp_path):
    found = answers(tmp_path)
    assert found.total.logs == 0
    assert found.total.lost.value is None
    assert set(found.total.states) == set(STATES)
    assert [found.spots, found.areas, found.picks, found.steps, found.maps] == [()] * 5


def test_a_fleet_of_failed_logs_says_so(tmp_path):
    commit(tmp_path, tables(logs=[failed_row("a"), failed_row("b")]))
    found = answers(tmp_path)
    assert (found.total.logs, found.total.failed, found.total.lost.n) == (2, 2, 0)
    assert [pick.reason for pick in found.picks] == ["it could not be judged: cut off"] * 2


def test_a_log_under_two_names_counts_once(tmp_path):
    logs = [
        log_row("a", content="c", log="x/1.mcap"),
        failed_row("b", content="c", log="a/first.mcap"),
        log_row("d", content=None, log="x/1.mcap"),
    ]
    commit(tmp_path, tables(logs=logs))
    found = answers(tmp_path)
    assert found.total.logs == 2
    (copies,) = found.copies
    assert (copies.counted, copies.logs) == ("a", ("a/first.mcap", "x/1.mcap"))
    # Read again otherwise, under the same name: the newest counts.
    commit(tmp_path, tables(logs=[log_row("0", content="c", log="x/1.mcap", state="lost")]))
    assert answers(tmp_path).copies[0].counted == "0"


def _visits(folder, course, robots=2, **told):
    """Logs one day after the other; of each character one: x contradicts a rack, . finds it."""
    logs, places = [], []
    for k, what in enumerate(course):
        key = f"{k:02d}"
        logs.append(log_row(key, start_ns=DAY0 + 24 * k * HOUR, robot=f"r{k % robots}", **told))
        for col in (2, 3):
            m2 = 0.2 if what == "x" else 0.0
            places.append(place_row(key, col, 5, here_s=0.0, contradicted_m2=m2))
        places.append(place_row(key, 2, 3, here_s=36.0))
    commit(folder, tables(logs=logs, places=places))
    return answers(folder).areas


@pytest.mark.parametrize(
    ("course", "robots", "advice", "persistence", "latest"),
    [
        ("..xxxx", 2, "re-map", 1.0, 4),
        ("..xxxx", 1, "re-map", 1.0, 4),  # nobody else has looked
        ("xxxxxx", 3, "re-map", 1.0, 6),
        ("..x...", 2, "temporary", 0.0, -3),  # a pallet came and went
        ("xxxx..", 2, "temporary", 0.6, -2),  # somebody put the rack back
        ("xxxx.", 2, "re-map", 0.75, -1),  # one look may miss it
        ("xx.", 2, "watch", 0.5, -1),
        (".....x", 2, "watch", None, 1),
        ("....xx", 2, "watch", 1.0, 2),
        ("x...xxxx", 2, "re-map", 4 / 7, 4),  # a pallet long ago does not hide a change
        ("xx.xxxx", 2, "re-map", 5 / 6, 4),  # one look that missed it does not, either
        ("x.x.x.x", 3, "watch", 0.5, 1),
        ("xx..x..x", 2, "watch", 3 / 7, 1),
    ],
)
def test_advice_follows_what_later_logs_saw(tmp_path, course, robots, advice, persistence, latest):
    (area,) = _visits(tmp_path, course, robots)
    assert (area.advice, area.persistence, area.latest) == (advice, persistence, latest)
    assert area.box_m == (2.0, 5.0, 4.0, 6.0)
    assert area.m2 == pytest.approx(0.4)
    assert area.near_h == pytest.approx(len(course) * 36.0 / 3600.0)
    assert area.logs == course.count("x")
    assert area.first_day == date(2026, 1, 1 + course.index("x"))


def test_who_was_lost_beside_an_area_counts_from_its_first_sighting_on(tmp_path):
    logs, places = [], []
    for k in range(6):
        logs.append(log_row(f"{k}", start_ns=DAY0 + k * HOUR, robot=f"r{k % 2}", state="lost"))
        places.append(place_row(f"{k}", 0, 0, contradicted_m2=0.3 if k >= 2 else 0.0))
        places.append(place_row(f"{k}", 1, 0, here_s=16.0, lost_s=2.0**k))
    # Of two that start at once the key decides, and of a clock without a day nobody knows.
    logs.append(log_row("1z", start_ns=DAY0 + 2 * HOUR, state="lost"))
    logs.append(log_row("sim", start_ns=3 * 10**9, state="lost"))
    places += [place_row(key, 1, 0, lost_s=64.0) for key in ("1z", "sim")]
    # Lost for a moment: no lost log, but time lost all the same.
    logs.append(log_row("7", start_ns=DAY0 + 7 * HOUR))
    places.append(place_row("7", 1, 0, lost_s=0.5))
    commit(tmp_path, tables(logs=logs, places=places))
    (area,) = answers(tmp_path).areas
    assert (area.lost_near, area.lost_near_s) == (4, 4.0 + 8.0 + 16.0 + 32.0 + 0.5)


def test_one_robot_that_contradicts_what_others_find_is_not_believed(tmp_path):
    logs, places = [], []
    for k in range(8):
        logs.append(log_row(f"{k}", start_ns=DAY0 + k * HOUR, robot=f"r{k % 2}"))
        m2 = 0.3 if k % 2 else 0.0
        places.append(place_row(f"{k}", 0, 0, contradicted_m2=m2))
    logs += [log_row(f"9{k}", start_ns=DAY0 + (20 + k) * HOUR, robot="r1") for k in range(4)]
    places += [place_row(f"9{k}", 0, 0, contradicted_m2=0.3) for k in range(4)]
    commit(tmp_path, tables(logs=logs, places=places))
    (area,) = answers(tmp_path).areas
    assert (area.advice, area.robots) == ("watch", 1)
    assert "only one found it so" in area.why


def test_a_place_that_stays_wrong_is_no_area_with_one_that_was_found_right_again(tmp_path):
    logs, places = [], []
    for k in range(6):
        logs.append(log_row(f"{k}", start_ns=DAY0 + k * HOUR, robot=f"r{k % 2}"))
        places.append(place_row(f"{k}", 0, 0, contradicted_m2=0.3))
        places.append(place_row(f"{k}", 1, 0, contradicted_m2=0.3 if k == 1 else 0.0))
        # Its edge is seen by some, and is of it.
        places.append(place_row(f"{k}", 0, 1, contradicted_m2=0.1 if k in (2, 3) else 0.0))
    commit(tmp_path, tables(logs=logs, places=places))
    stays, went = answers(tmp_path).areas
    assert (stays.advice, stays.box_m) == ("re-map", (0.0, 0.0, 1.0, 2.0))
    assert (went.advice, went.box_m) == ("temporary", (1.0, 0.0, 2.0, 1.0))


def test_a_log_that_only_saw_a_corner_says_nothing_of_the_area(tmp_path):
    logs, places = [], []
    for k in range(5):
        logs.append(log_row(f"{k}", start_ns=DAY0 + k * HOUR, robot=f"r{k % 2}"))
        places += [place_row(f"{k}", col, 0, contradicted_m2=0.3) for col in range(8)]
    logs.append(log_row("5", start_ns=DAY0 + 5 * HOUR, robot="r1"))
    places.append(place_row("5", 7, 0))
    commit(tmp_path, tables(logs=logs, places=places))
    (area,) = answers(tmp_path).areas
    assert (area.logs, area.visits, area.still, area.advice) == (5, 4, 4, "re-map")


def test_a_map_that_was_replaced_comes_last(tmp_path):
    logs, places = [], []
    for k in range(8):
        version = "sha256:old" if k < 4 else "sha256:new"
        start = DAY0 + (k if k < 4 else 24 * 30 + k) * HOUR
        logs.append(log_row(f"{k}", start_ns=start, robot=f"r{k % 2}", map_version=version))
        here = 500.0 if k < 4 else 5.0
        places.append(
            place_row(f"{k}", 0, 0, contradicted_m2=0.3, map_version=version, here_s=here)
        )
    commit(tmp_path, tables(logs=logs, places=places))
    found = answers(tmp_path)
    assert [(a.map_version, a.in_use) for a in found.areas] == [
        ("sha256:new", True),
        ("sha256:old", False),
    ]
    assert [m.map_version for m in found.maps] == ["sha256:new", "sha256:old"]


def test_logs_whose_clock_tells_no_day_do_not_make_a_change_old(tmp_path):
    logs = [log_row(f"{k}", start_ns=DAY0 + k * HOUR, robot=f"r{k % 2}") for k in range(4)]
    logs.append(log_row("sim", start_ns=3 * 10**9))
    places = [place_row(row["key"], 0, 0, contradicted_m2=0.3) for row in logs]
    commit(tmp_path, tables(logs=logs, places=places))
    (area,) = answers(tmp_path).areas
    assert (area.first_day, area.logs) == (date(2026, 1, 1), 4)
    assert any("tell no day" in remark for remark in answers(tmp_path).remarks)


def test_trouble_begins_with_the_first_interval_of_it(tmp_path):
    def part(state, from_s, to_s, key="a"):
        start, end = (DAY0 + int(s * 1e9) for s in (from_s, to_s))
        return {"key": key, "state": state, "start_ns": start, "end_ns": end}

    intervals = [
        part("healthy", 0, 9),
        part("map_changed", 9.5, 12),
        part("lost", 12, 20),
        part("healthy", 0, 9, "b"),
    ]
    commit(tmp_path, tables(logs=[log_row("a"), log_row("b")], intervals=intervals))
    assert answers(tmp_path).troubles_s == {"a": 9.5}


def test_one_visit_does_not_top_the_list_of_spots(tmp_path):
    logs, places = [], []
    for k in range(20):
        key = f"{k:02d}"
        logs.append(log_row(key, state="lost" if k < 8 else "healthy", lost_s=10.0))
        was = {"lost_s": 4.0, "entered_lost": 1} if k < 6 else {}
        places.append(place_row(key, 0, 0, **was))
    # Lost at 40, 40 for long: one log of one, and one of many.
    places.append(place_row("06", 40, 40, here_s=900.0, lost_s=900.0, entered_lost=1))
    places += [place_row(f"{k:02d}", 20, 20) for k in range(8, 20)]
    places.append(place_row("07", 20, 20, lost_s=8.0, entered_lost=1))
    commit(tmp_path, tables(logs=logs, places=places))
    found = answers(tmp_path).spots
    assert [(spot.box_m[0], spot.lost.count, spot.lost.n) for spot in found] == [
        (0.0, 6, 20),
        (20.0, 1, 13),
    ]


def test_one_log_of_each_kind_comes_before_a_second_of_any(tmp_path):
    logs, places = [], []
    for k in range(6):
        key = f"k{k}"
        logs.append(log_row(key, state="lost", failure_mode="kidnapped", lost_s=500.0 + k))
        places.append(place_row(key, 0, 0, lost_s=5.0, entered_lost=1))
    logs.append(log_row("s", state="lost", failure_mode="odometry_slip", lost_s=9.0))
    logs.append(log_row("g", gate="failed"))
    logs.append(log_row("d", confidence=0.6))
    logs.append(log_row("p", stops=1))
    logs.append(failed_row("u"))
    logs.append(log_row("fine"))
    commit(tmp_path, tables(logs=logs, places=places))
    found = answers(tmp_path).picks
    assert [pick.key for pick in found[:7]] == ["k5", "g", "u", "d", "p", "s", "k4"]
    assert found[0].alike == 6
    assert found[0].reason == "lost for 8 min"
    assert "fine" not in [pick.key for pick in found]


def test_a_version_is_compared_where_both_ran_alone(tmp_path):
    logs = [log_row(f"a{k}", software="1", state="lost" if k < 2 else "healthy") for k in range(40)]
    later = {"software": "2", "start_ns": DAY0 + HOUR}
    logs += [log_row(f"b{k}", **later, state="lost" if k < 20 else "healthy") for k in range(40)]
    # Another site that only the new one ran at, where nothing goes wrong.
    logs += [log_row(f"c{k}", **later, site="south", robot="r9") for k in range(400)]
    commit(tmp_path, tables(logs=logs))
    lost = next(step for step in answers(tmp_path).steps if step.measure == "lost")
    assert (lost.was.count, lost.was.n, lost.now.count, lost.now.n) == (2, 40, 20, 40)
    assert (lost.verdict, lost.sites, lost.robots) == ("worse", 1, 1)


@pytest.mark.parametrize(("logs_before", "said"), [(4, "not told apart"), (5, "worse")])
def test_few_logs_of_a_version_tell_nothing(tmp_path, logs_before, said):
    later = {"software": "2", "start_ns": DAY0 + HOUR, "state": "lost"}
    logs = [log_row(f"a{k}", software="1", robot=f"r{k}") for k in range(logs_before)]
    logs += [log_row(f"b{k}", robot=f"r{k}", **later) for k in range(10)]
    commit(tmp_path, tables(logs=logs))

    lost = next(step for step in answers(tmp_path).steps if step.measure == "lost")

    assert lost.low > 0
    assert lost.verdict == said


@pytest.mark.parametrize(("lost", "said"), [(11, "not told apart"), (20, "worse")])
def test_the_more_is_compared_the_more_it_takes_to_be_worse(tmp_path, lost, said):
    def logs(software, start, lost):
        return [
            log_row(f"{software}{k}", software=software, robot=f"r{k}", start_ns=start,
                    state="lost" if k < lost else "healthy", gate="passed",
                    failure_mode=f"mode {k % 8}" if k < lost else "none")
            for k in range(40)
        ]  # fmt: skip

    commit(tmp_path, tables(logs=logs("1", DAY0, 3) + logs("2", DAY0 + HOUR, lost)))
    found = answers(tmp_path).steps
    one = next(step for step in found if step.measure == "lost")

    assert len(found) == 4 + 8
    assert newcombe((3 / 40, 40), (lost / 40, 40))[0] > 0  # alone it would be worse
    assert one.verdict == said
    assert (one.low, one.high) == newcombe((3 / 40, 40), (lost / 40, 40), z_of(12))


@pytest.mark.parametrize(("times", "spread"), [((4, 4, 4, 4, 4), 1.0), ((0, 0, 0, 0, 20), 20.0)])
def test_rates_are_as_wide_as_robots_differ_and_of_one_robot_as_its_logs_do(
    tmp_path, times, spread
):
    logs = [
        log_row(f"{robot}{k}", robot=robot, lost_times=n if robot == "d" else 0)
        for robot in "abcd"
        for k, n in enumerate(times)
    ]
    commit(tmp_path, tables(logs=logs))
    found = answers(tmp_path)
    robot = found.by["robot"][3].lost_per_km

    # Robots: 0, 0, 0 and 20 where 5 each were expected, (3 * 25 + 225) / 5 over 3 degrees.
    assert (found.total.lost_per_km.low, found.total.lost_per_km.high) == pytest.approx(
        garwood(20 / 20.0, 2.0 / 20.0)
    )
    # Logs of d: 4 each were expected, over 4 degrees.
    assert (robot.low, robot.high) == pytest.approx(garwood(20 / spread, 0.5 / spread))
