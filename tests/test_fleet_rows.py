"""Rows of a fleet's tables, from post-mortems that were made by hand."""

import io
from dataclasses import replace
from datetime import date

import numpy as np
import pytest
from posts import S, bare_post, lost_post

from slamreplay.bundle.freshness import NEVER, Freshness
from slamreplay.bundle.map_course import Held, MapStretch
from slamreplay.bundle.products import Part
from slamreplay.bundle.track import PoseTrack
from slamreplay.fleet.places import became_lost, places_of
from slamreplay.fleet.rows import costs_row, day_of, driven_m, failed_rows, rows_of
from slamreplay.fleet.schema import STEP, TABLES, arrow_schema
from slamreplay.report.build import build
from slamreplay.testing.synthetic import START_NS

LABELS = {"site": "north", "robot": "r1", "floor": "2"}


def _rows(post, **changed):
    told = {
        "key": "k1", "log": "a/run.mcap", "content": "c1", "bytes": 7, "labels": LABELS,
        "gate": None, "report_folder": "logs/run-k1",
    }  # fmt: skip
    return rows_of(post, build(post), **(told | changed))


@pytest.fixture(scope="module")
def post():
    return lost_post()


def _walk(post, xy, every_s=0.1):
    """The post-mortem with hindsight along points (N, 2), and its map's version."""
    t = START_NS + np.rint(np.arange(len(xy)) * every_s * S).astype(np.int64)
    poses = np.column_stack([xy, np.zeros(len(xy))])
    track = PoseTrack.without_covariance("map", "base_link", t, poses)
    return replace(post, hindsight=replace(post.hindsight, track=track))


def test_a_log_is_one_row_of_its_numbers(post):
    (row,) = _rows(post)["logs"].to_pylist()
    assert (row["status"], row["state"], row["failure_mode"]) == ("done", "lost", "kidnapped")
    assert (row["site"], row["robot"], row["software"]) == ("north", "r1", None)
    lost = post.judgement.intervals[1]
    assert row["lost_s"] == pytest.approx((lost.end_ns - lost.start_ns) / 1e9)
    assert (row["lost_times"], row["stops"], row["errors"], row["warnings"]) == (1, 1, 1, 1)
    assert row["changed_s"] == 0.0
    assert row["judged_s"] == (row["end_ns"] - row["start_ns"]) / 1e9
    assert row["max_error_m"] == 1.5
    assert row["map_version"] == post.grid.version


def test_every_table_has_its_schema_and_the_key(post):
    tables = _rows(post)
    assert set(tables) | {"costs"} == set(TABLES)
    for name, table in tables.items():
        assert table.schema.equals(arrow_schema(name), check_metadata=True)
        assert set(table["key"].to_pylist()) <= {"k1"}
    assert tables["findings"].num_rows == len(post.findings)
    assert tables["intervals"].num_rows == 2
    appeared = tables["regions"].to_pylist()[0]
    assert (appeared["x_min_m"], appeared["y_max_m"]) == (4.6, 5.6)
    assert appeared["map_version"] == post.grid.version


def test_the_same_post_mortem_gives_the_same_bytes(post):
    import pyarrow.parquet as pq

    def written():
        sinks = []
        for table in _rows(lost_post()).values():
            sinks.append(io.BytesIO())
            pq.write_table(table, sinks[-1], compression="zstd")
        return [sink.getvalue() for sink in sinks]

    first = written()
    assert first == written()
    assert not any(b"pandas" in content for content in first)


def test_a_log_without_map_and_belief_has_a_row_of_unknowns(post):
    tables = _rows(bare_post(post), labels={})
    (row,) = tables["logs"].to_pylist()
    assert row["state"] == "insufficient_data"
    assert row["judged_s"] == 0.0
    for name in ("map_version", "driven_m", "max_error_m", "site", "root_cause", "confidence"):
        assert row[name] is None
    assert tables["places"].num_rows == 0


def test_a_failed_log_is_one_row_with_its_line():
    (table,) = failed_rows("cut\ud800 off", key="k", log="x.bag", labels={"site": "a"}).values()
    (row,) = table.to_pylist()
    assert (row["status"], row["error"], row["site"]) == ("failed", "cut\ufffd off", "a")
    assert row["state"] is None
    assert row["lost_s"] is None


def test_costs_stand_apart():
    (table,) = costs_row(key="k", cpu_s=1.5, wall_s=2.0, peak_mb=None, attempts=1).values()
    assert table.to_pylist()[0]["cpu_s"] == 1.5
    assert table.schema.equals(arrow_schema("costs"), check_metadata=True)


@pytest.mark.parametrize(
    ("t_ns", "day"),
    [
        (1_750_000_000 * S, date(2025, 6, 15)),
        (1_749_945_600 * S, date(2025, 6, 15)),  # midnight
        (1_749_945_600 * S - 1, date(2025, 6, 14)),
        (12 * S, None),  # simulated time
        (946_684_800 * S - 1, None),
        (4_102_444_800 * S, None),
        (np.iinfo(np.int64).max, None),
        (-S, None),
    ],
)
def test_the_day_is_told_by_clocks_of_the_wall_alone(t_ns, day):
    assert day_of(t_ns) == day


def test_time_is_counted_where_the_robot_really_was(post):
    xy = np.column_stack([np.full(200, -0.5), np.where(np.arange(200) < 100, 0.5, 1.5)])
    places = places_of(_walk(post, xy))
    assert places["col"].tolist() == [-1, -1]
    assert places["row"].tolist() == [0, 1]
    assert places["here_s"][0] == 10.0
    assert places["lost_s"].tolist() == [0.0, places["here_s"][1]]
    assert places["entered_lost"].tolist() == [0, 1]
    assert places["here_s"].sum() == pytest.approx(19.9, abs=0.11)


def test_what_nobody_knows_is_no_time_anywhere(post):
    xy = np.full((200, 2), 0.5)
    xy[50:150] = np.nan
    places = places_of(_walk(post, xy))
    # 5 s, one pose that holds for a second, and the rest.
    assert places["here_s"].sum() == pytest.approx(4.9 + 1.0 + 4.95, abs=0.1)
    # It became lost in the middle of the gap: nobody knows where.
    assert places["entered_lost"].sum() == 0


def test_cells_of_the_map_are_counted_by_their_area_in_the_frame_of_the_map(post):
    confirmed = np.full((20, 20), NEVER)
    confirmed[:10] = 5
    contradicted = np.full((20, 20), NEVER)
    contradicted[0, :4] = 9  # after it was confirmed
    contradicted[1, :4] = 3  # before
    # Turned by a quarter: columns of the lattice go along y of the map.
    fresh = Freshness(confirmed, contradicted, 0.1, np.array([3.0, 7.0, np.pi / 2]), 10)
    still = _walk(post, np.full((200, 2), 0.5))
    changes = replace(still.hindsight.changes, freshness=fresh)
    places = places_of(replace(still, hindsight=replace(still.hindsight, changes=changes)))
    seen = {
        (col, row): (m2, against)
        for col, row, m2, against in zip(
            places["col"].tolist(), places["row"].tolist(),
            places["seen_m2"].tolist(), places["contradicted_m2"].tolist(), strict=True,
        )
        if m2
    }  # fmt: skip
    assert seen == {
        (2, 7): (1.0, pytest.approx(0.04, abs=STEP)),
        (2, 8): (1.0, 0.0),
    }


def test_a_map_that_held_twice_was_looked_at_once(post):
    fresh = Freshness(
        np.full((20, 20), 5), np.full((20, 20), NEVER), 0.1, np.array([3.0, 7.0, 0.0]), 10
    )
    still = _walk(post, np.full((200, 2), 0.5))
    changes = replace(still.hindsight.changes, freshness=fresh)
    found = replace(still.hindsight, changes=changes)
    middle, end = START_NS + 10 * S, START_NS + 20 * S
    halves = tuple(
        Part(MapStretch((Held("sha256:a", *span),)), found)
        for span in ((START_NS, middle), (middle, end))
    )
    one = places_of(replace(still, hindsight=found))
    two = places_of(replace(still, hindsight=replace(found, parts=halves)))
    assert one["seen_m2"].max() == 1.0
    for name in ("col", "row", "seen_m2", "here_s"):
        np.testing.assert_array_equal(one[name], two[name])


def test_sums_are_exact_in_any_order(post):
    places = places_of(_walk(post, np.random.default_rng(1).uniform(0, 4, (200, 2)), 0.0987))
    values = places["here_s"]
    assert np.array_equal(values, np.rint(values * 1024) / 1024)
    assert sum(values.tolist()) == sum(values[::-1].tolist())


def test_each_map_of_a_log_has_places_of_its_own(post):
    whole = _walk(post, np.column_stack([np.linspace(0.1, 3.9, 200), np.full(200, 0.5)]))
    middle, end = START_NS + 10 * S, START_NS + 20 * S
    first = MapStretch((Held("sha256:a", START_NS, middle),))
    second = MapStretch((Held("sha256:b", middle, end),))
    parts = (Part(first, whole.hindsight), Part(second, whole.hindsight))
    both = replace(whole, hindsight=replace(whole.hindsight, parts=parts))
    places = places_of(both)
    by_map = list(zip(places["map_version"], places["col"].tolist(), strict=True))
    assert by_map == [(f"sha256:{m}", c) for m, c in (("a", 0), ("a", 1), ("b", 2), ("b", 3))]
    assert _rows(both)["stops"].to_pylist()[0]["map_version"] == "sha256:b"


def test_trembling_is_no_driving_and_being_carried_is_none(post):
    rng = np.random.default_rng(2)
    standing = rng.normal(0.0, 0.01, (200, 2))
    assert driven_m(_walk(post, standing)) < 0.1
    driving = standing + np.column_stack([np.arange(200) * 0.05, np.zeros(200)])
    assert driven_m(_walk(post, driving)) == pytest.approx(9.5, abs=0.3)
    driving[100:] += 50.0
    assert driven_m(_walk(post, driving)) == pytest.approx(9.0, abs=0.6)


def test_a_map_that_changes_meanwhile_is_no_new_loss(post):
    lost = post.judgement.intervals[1]
    middle = lost.start_ns + 3 * S
    parts = (
        post.judgement.intervals[0],
        replace(lost, end_ns=middle),
        replace(lost, start_ns=middle, state="lost_and_map_changed"),
    )
    changed = replace(post, judgement=replace(post.judgement, intervals=parts))
    assert became_lost(changed).tolist() == [lost.start_ns]
