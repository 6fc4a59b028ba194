"""Intervals tile the log, flicker goes, and the log-level rules are those that were agreed."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slamreplay.verdict.intervals import log_state, state_of, tiled
from slamreplay.verdict.judgement import STATES, Interval
from slamreplay.verdict.limits import Limits
from slamreplay.verdict.timeline import BAD, GOOD, UNKNOWN, Stretch, held, merged, settled

S = 1_000_000_000


@st.composite
def flags(draw):
    """Scan times with uneven gaps, a flag each, and a log that may begin and end elsewhere."""
    gaps = draw(st.lists(st.sampled_from([0.05, 0.1, 0.2, 0.7, 1.5, 4.0]), max_size=60))
    t = np.cumsum(np.array(gaps) * S).astype(np.int64) + 10 * S
    values = draw(st.lists(st.sampled_from([GOOD, BAD, UNKNOWN]), min_size=len(t), max_size=len(t)))
    start = 10 * S - round(draw(st.floats(-1.0, 3.0)) * S)
    end = max(start, 10 * S) + round(draw(st.floats(0.001, 60.0)) * S)
    return t, np.array(values, dtype=np.int8), start, end


def assert_tiles(parts, start, end):
    assert parts[0].start_ns == start
    assert parts[-1].end_ns == end
    for a, b in pairwise(parts):
        assert a.end_ns == b.start_ns
    assert all(p.end_ns > p.start_ns for p in parts)


@given(flags(), flags())
@settings(max_examples=150, deadline=None)
def test_intervals_tile_the_log_without_gap_or_overlap(one, two):
    start, end = one[2], one[3]
    lost = settled(held(one[0], one[1], start, end, S), 3 * S, S)
    changed = settled(held(two[0], two[1], start, end, S), 2 * S, S)
    tiles = tiled(lost, changed)

    assert_tiles(tiles, start, end)
    assert all(a.state != b.state for a, b in pairwise(tiles))


@given(flags())
@settings(max_examples=300, deadline=None)
def test_settling_keeps_the_span_and_changes_nothing_twice(case):
    t, values, start, end = case
    once = settled(held(t, values, start, end, S), 3 * S, S)

    assert_tiles(once, start, end)
    assert settled(once, 3 * S, S) == once
    assert all(s.duration_ns >= 3 * S for s in once if s.value == BAD)
    bad = [s for s in once if s.value == BAD]
    assert all(b.start_ns - a.end_ns >= S for a, b in pairwise(bad))


def line(*parts):
    """A timeline of (value, seconds)."""
    edges = np.cumsum([0, *(seconds for _, seconds in parts)])
    return merged(
        Stretch(value, round(a * S), round(b * S))
        for (value, _), a, b in zip(parts, edges, edges[1:], strict=False)
    )


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ([(GOOD, 5), (BAD, 2.9), (GOOD, 5)], [(GOOD, 12.9)]),
        ([(GOOD, 5), (BAD, 3), (GOOD, 5)], [(GOOD, 5), (BAD, 3), (GOOD, 5)]),
        ([(BAD, 2), (GOOD, 0.9), (BAD, 2)], [(BAD, 4.9)]),
        ([(BAD, 2), (GOOD, 1.0), (BAD, 2)], [(GOOD, 5)]),
        ([(BAD, 4), (UNKNOWN, 0.4), (GOOD, 0.4), (BAD, 4)], [(BAD, 8.8)]),
        ([(GOOD, 4), (UNKNOWN, 0.9), (GOOD, 4)], [(GOOD, 8.9)]),
        ([(GOOD, 4), (UNKNOWN, 2), (GOOD, 4)], [(GOOD, 4), (UNKNOWN, 2), (GOOD, 4)]),
        ([(UNKNOWN, 4), (GOOD, 0.2), (UNKNOWN, 4)], [(UNKNOWN, 8.2)]),
    ],
)
def test_what_is_short_is_settled(before, after):
    assert settled(line(*before), 3 * S, S) == line(*after)


def test_a_long_gap_between_scans_is_not_known():
    t = np.array([0, 1, 2, 12, 13]) * S // 10 * 10
    found = held(t, np.zeros(5, dtype=np.int8), 0, 14 * S, S)

    assert [(s.value, s.start_ns // S, s.end_ns // S) for s in found] == [
        (GOOD, 0, 3),  # one usual spacing of a second after the last sample
        (UNKNOWN, 3, 12),
        (GOOD, 12, 14),
    ]


def test_a_gap_of_more_than_a_second_ends_an_interval_and_adds_nothing_to_it():
    t = np.concatenate([np.arange(0, 24), np.arange(36, 80)]) * (S // 10)
    flags = np.where((t >= S // 2) & (t < 5 * S), BAD, GOOD).astype(np.int8)
    lost = settled(held(t, flags, 0, 8 * S, S), 3 * S, S)

    assert [s.value for s in lost] == [GOOD, UNKNOWN, GOOD]  # 1.9 and 1.4 s are no three seconds
    assert lost[0].end_ns == 24 * S // 10


def test_every_pair_of_answers_has_its_state():
    assert state_of(GOOD, GOOD) == "healthy"
    assert state_of(BAD, UNKNOWN) == "lost"
    assert state_of(UNKNOWN, BAD) == "map_changed"
    assert state_of(BAD, BAD) == "lost_and_map_changed"
    assert state_of(GOOD, UNKNOWN) == state_of(UNKNOWN, GOOD) == "insufficient_data"


@pytest.mark.parametrize(
    ("seconds", "state"),
    [
        ({"healthy": 60}, "healthy"),
        ({"healthy": 60, "lost": 4.9}, "healthy"),
        ({"healthy": 60, "lost": 5}, "lost"),
        ({"healthy": 60, "map_changed": 5}, "map_changed"),
        ({"healthy": 60, "lost": 5, "map_changed": 5}, "lost_and_map_changed"),
        ({"healthy": 60, "lost": 5, "map_changed": 4}, "lost"),
        ({"healthy": 60, "lost": 4, "map_changed": 5}, "map_changed"),
        ({"lost_and_map_changed": 5}, "lost_and_map_changed"),
        ({"lost_and_map_changed": 3, "lost": 2, "map_changed": 1}, "lost"),
        ({"insufficient_data": 31, "healthy": 30}, "insufficient_data"),
        ({"insufficient_data": 30, "healthy": 30}, "healthy"),
        ({"insufficient_data": 90, "lost": 5}, "lost"),
        ({"unobservable": 31, "healthy": 30}, "unobservable"),
        ({"unobservable": 20, "insufficient_data": 20, "healthy": 30}, "insufficient_data"),
        ({}, "insufficient_data"),
    ],
)
def test_log_level_rule(seconds, state):
    intervals, t = [], 0
    for name, duration in seconds.items():
        assert name in STATES
        intervals.append(Interval(name, t, t + round(duration * S)))
        t = intervals[-1].end_ns

    assert log_state(intervals, Limits()) == state


def test_limits_can_be_set():
    intervals = [Interval("lost", 0, 2 * S), Interval("healthy", 2 * S, 60 * S)]

    assert log_state(intervals, Limits(total_s=2.0)) == "lost"
