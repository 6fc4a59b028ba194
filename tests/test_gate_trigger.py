"""A number over time against a limit: the vectorised trigger beside a slow one that is obvious."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slamreplay.gate.trigger import BRIDGE_NS, HOLD_SPACINGS, Excursion, excursions

S = 1_000_000_000


def slowly(t_ns, values, limit, clear, *, above, for_ns=0):
    """Sample by sample, with a state."""
    known = [(int(t), float(v)) for t, v in zip(t_ns, values, strict=True) if v == v]
    steps = sorted(b[0] - a[0] for a, b in pairwise(known))
    usual = 0
    if steps:
        middle = len(steps) // 2
        usual = int(steps[middle] if len(steps) % 2 else (steps[middle - 1] + steps[middle]) / 2)
    reach = max(BRIDGE_NS, HOLD_SPACINGS * usual)
    found, start, worst = [], None, None
    for k, (t, v) in enumerate(known):
        after_gap = k > 0 and t - known[k - 1][0] > reach
        if after_gap and start is not None:
            found.append(Excursion(start, known[k - 1][0] + usual, worst))
            start = None
        is_beyond = v > limit if above else v < limit
        is_clear = v <= clear if above else v >= clear
        if start is None and is_beyond:
            start, worst = t, v
        elif start is not None and is_clear:
            found.append(Excursion(start, t, worst))
            start = None
        elif start is not None:
            worst = max(worst, v) if above else min(worst, v)
    if start is not None:
        found.append(Excursion(start, known[-1][0] + usual, worst))
    return tuple(one for one in found if one.end_ns - one.start_ns >= for_ns)


@settings(max_examples=300, deadline=None)
@given(
    samples=st.lists(
        st.tuples(
            st.sampled_from([0, S // 10, S // 10, S // 10, S, 2 * S, 20 * S]),
            st.sampled_from([0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 2.0, np.nan, np.inf]),
        ),
        max_size=60,
    ),
    clear=st.sampled_from([0.2, 0.3, 0.5]),
    above=st.booleans(),
    for_ns=st.sampled_from([0, S // 10, S, 5 * S]),
)
def test_it_is_the_obvious_one(samples, clear, above, for_ns):
    t = np.cumsum(np.array([step for step, _ in samples], dtype=np.int64))
    values = np.array([value for _, value in samples], dtype=np.float64)
    sign = 1.0 if above else -1.0
    how = {"limit": sign * 0.5, "clear": sign * clear, "above": above, "for_ns": for_ns}

    assert excursions(t, sign * values, **how) == slowly(t, sign * values, **how)


def found(values, *, clear=0.5, for_s=0, above=True, t=None):
    """In s: from, to and worst, at 10 Hz."""
    t = np.arange(len(values)) * S // 10 if t is None else np.asarray(t)
    told = excursions(t, values, 0.5, clear, above=above, for_ns=for_s * S)
    return [(one.start_ns / S, one.end_ns / S, one.worst) for one in told]


def test_it_stays_beyond_until_it_is_clear():
    """As an alarm that a value on the edge would else ring again and again."""
    values = [0.4, 0.6, 0.45, 0.55, 0.45, 0.3, 0.45, 0.3]

    assert found(values) == [(0.1, 0.2, 0.6), (0.3, 0.4, 0.55)]
    assert found(values, clear=0.35) == [(0.1, 0.5, 0.6)]


def test_at_the_limit_it_holds():
    assert found([0.5, 0.5]) == []
    assert found([0.5, 0.5], above=False) == []
    assert found([0.6, 0.2, 0.6], above=False) == [(0.1, 0.2, 0.2)]


def test_short_ones_are_left_out():
    values = [0.6] * 5 + [0.0] * 5 + [0.6] * 20 + [0.0]

    assert found(values, for_s=1) == [(1.0, 3.0, 0.6)]
    assert found(values, for_s=2) == [(1.0, 3.0, 0.6)]  # as long as that is long enough
    assert found(values, for_s=3) == []


def test_a_gap_is_no_evidence():
    """Beyond the limit on both sides of ten seconds without data is no excursion of ten."""
    t = np.append(np.arange(10), np.arange(110, 120)) * (S // 10)

    assert found([0.6] * 20, t=t) == [(0.0, 1.0, 0.6), (11.0, 12.0, 0.6)]
    assert found([0.6] * 20, t=t, for_s=2) == []
    # Between limit and clear after a gap nothing is known to be wrong.
    assert found([0.6] * 10 + [0.45] * 10, t=t, clear=0.2) == [(0.0, 1.0, 0.6)]
    hole = np.full(100, 0.6)
    hole[40:60] = np.nan
    assert found(hole) == [(0.0, 4.0, 0.6), (6.0, 10.0, 0.6)]
    hole[43:57] = 0.6  # holes of 0.3 s are samples that are missing
    assert found(hole) == [(0.0, 10.0, 0.6)]


@pytest.mark.parametrize("values", [[], [np.nan], [np.nan, np.nan]])
def test_nothing_is_no_excursion(values):
    assert found(values) == []


def test_each_crossing_of_an_hour_at_100_hz_counts():
    t = np.arange(360_000) * (S // 100)
    values = np.abs(np.sin(np.arange(360_000) / 500.0))

    assert len(excursions(t, values, 0.9, 0.5, above=True)) == 229
