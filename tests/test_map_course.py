"""Which map held when, and whether two versions are of one place."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from rooms import boxed, mapped_until, upstairs, with_cells

from slamreplay.bundle.map_course import SHORTEST_NS, Held, map_course, map_stretches
from slamreplay.bundle.schema import TABLES
from slamreplay.bundle.tables import Table
from slamreplay.geometry import se2
from slamreplay.maps.grid import OccupancyGrid
from slamreplay.maps.versions import changed_cells, same_place
from slamreplay.testing.synthetic import room_grid

# --- which version held when -----------------------------------------------------------------


def updates(rows):
    t_ns = [t for t, _ in rows]
    named = {"map_version": [v for _, v in rows], "frame_id": ["map"] * len(rows)}
    times = {"t_ns": t_ns, "t_sensor_ns": t_ns, "t_log_ns": t_ns}
    return Table(TABLES["map_updates"], {**times, "topic": ["/map"] * len(rows), **named})


def test_the_first_version_held_before_it_was_recorded():
    course = map_course(updates([(3, "a"), (5, "a"), (7, "b")]), ["a", "b"], 0, 9)
    assert course == (Held("a", 0, 7), Held("b", 7, 9))


def test_of_versions_before_the_start_only_the_last_held():
    course = map_course(updates([(-9, "a"), (-5, "b"), (4, "a")]), ["b", "a"], 0, 9)
    assert course == (Held("b", 0, 4), Held("a", 4, 9))


def test_where_a_version_was_not_kept_the_one_before_stands_in():
    course = map_course(updates([(1, "x"), (2, "a"), (4, "y"), (6, "b")]), ["a", "b"], 0, 9)
    assert course == (Held("a", 0, 6), Held("b", 6, 9))


def test_a_map_that_no_row_names_holds_all_along():
    assert map_course(updates([]), ["a"], 0, 9) == (Held("a", 0, 9),)
    assert map_course(updates([(1, "a")]), [], 0, 9) == ()


@given(
    st.lists(st.tuples(st.integers(-5, 15), st.sampled_from("abc")), min_size=1, max_size=8),
    st.integers(-2, 12),
)
def test_the_course_tiles_the_log_and_says_what_held(rows, t):
    course = map_course(updates(rows), ["a", "b"], 0, 10)

    known = sorted(((when, k, v) for k, (when, v) in enumerate(rows) if v != "c"))
    if not known:
        assert course == (Held("b", 0, 10),)
        return
    assert (course[0].start_ns, course[-1].end_ns) == (0, 10)
    assert all(one.end_ns == two.start_ns for one, two in pairwise(course))
    assert all(one.version != two.version for one, two in pairwise(course))
    if 0 <= t < 10:
        held = next(h.version for h in course if h.start_ns <= t < h.end_ns)
        before = [v for when, _, v in known if when <= t]
        assert held == (before[-1] if before else known[0][2])


# --- whether versions are of one place --------------------------------------------------------


def test_a_map_that_grows_or_has_a_box_more_stays_one_place():
    early, late = (mapped_until(room_grid(), t) for t in (1.0, 30.0))
    assert same_place(early, late)
    assert same_place(room_grid(), boxed())
    assert same_place(boxed(), room_grid())


def test_another_floor_with_the_same_outer_walls_is_another_place():
    assert not same_place(room_grid(), upstairs())
    assert not same_place(upstairs(), room_grid())
    assert not same_place(room_grid(), with_cells(room_grid().cells.copy(), "map_2"))


@given(st.integers(0, 50), st.integers(-3, 3), st.integers(-3, 3))
def test_changed_cells_are_those_of_the_laid_over_grids(seed, dx, dy):
    rng = np.random.default_rng(seed)
    old, new = (rng.choice([-1, 0, 40, 100], (5, 6)).astype(np.int8) for _ in range(2))
    origin = np.array([1.0, -2.0, 0.4])
    moved = se2.compose(origin, np.array([0.1 * dx, 0.1 * dy, 0.0]))
    wide = np.full((2, 15, 16), -1, dtype=np.int8)
    wide[0, 5:10, 5:11] = old
    wide[1, 5 + dy : 10 + dy, 5 + dx : 11 + dx] = new

    counted = changed_cells(OccupancyGrid(old, 0.1, origin), OccupancyGrid(new, 0.1, moved))

    assert counted == np.count_nonzero(wide[0] != wide[1])


def test_a_foreign_map_of_a_moment_is_not_judged_by_itself():
    grids = {"a": room_grid(), "b": upstairs()}
    long, short = SHORTEST_NS, SHORTEST_NS // 2
    course = [
        Held("b", 0, short),
        Held("a", short, short + long),
        Held("b", short + long, 2 * short + long),
        Held("a", 2 * short + long, 3 * long),
        Held("b", 3 * long, 5 * long),
    ]

    found = map_stretches(course, grids.get)

    assert [(s.version, s.start_ns, s.end_ns) for s in found] == [
        ("a", 0, 3 * long),
        ("b", 3 * long, 5 * long),
    ]
    flapping = [Held("ab"[k % 2], k * short, (k + 1) * short) for k in range(9)]
    (whole,) = map_stretches(flapping, grids.get)
    assert (whole.version, whole.start_ns, whole.end_ns) == ("a", 0, 9 * short)
