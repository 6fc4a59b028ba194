"""Times as text, and times that step back."""

from decimal import Decimal
from itertools import combinations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from slamreplay.geometry.times import decimal_seconds, from_decimal_seconds, in_order

NS = st.integers(-(2**63) + 1, 2**63 - 1)


@given(st.lists(NS, max_size=5))
def test_decimal_seconds_come_back_to_the_nanosecond(t_ns):
    found, is_time = from_decimal_seconds([decimal_seconds(t).encode() for t in t_ns])

    assert found.tolist() == t_ns
    assert is_time.all()


@given(st.decimals(allow_nan=False, allow_infinity=False, min_value=-(10**9), max_value=10**9))
def test_any_spelling_of_a_number_is_read_as_decimal_reads_it(value):
    found, is_time = from_decimal_seconds([str(value).encode()])

    assert found.tolist() == [int((Decimal(str(value)) * 10**9).to_integral_value())]
    assert is_time.all()


def test_what_is_no_time_is_told():
    texts = [b"1.5", b"nan", b"-inf", b"x", b"", b"1e999999", b"9223372037", b"1.2.3", b"\xff"]
    found, is_time = from_decimal_seconds(texts)

    assert found[0] == 1_500_000_000
    assert is_time.tolist() == [True] + [False] * 8


@given(st.lists(st.integers(0, 20), max_size=8))
def test_times_in_order_rise_and_the_fewest_are_moved(values):
    t_ns = np.array(values, dtype=np.int64)
    found, moved = in_order(t_ns)

    assert (np.diff(found) >= 0).all()
    np.testing.assert_array_equal(found[~moved], t_ns[~moved])
    most = max(
        (k for k in range(len(values), 0, -1)
         if any(list(c) == sorted(c) for c in combinations(values, k))), default=0,
    )  # fmt: skip
    assert int((~moved).sum()) == most


def test_a_time_that_is_moved_lies_between_its_neighbours_to_the_nanosecond():
    start = 1_700_000_000_000_000_001
    found, moved = in_order(start + np.array([0, 10, 900, 901, 40, 50]))

    assert (found - start).tolist() == [0, 10, 20, 30, 40, 50]
    assert moved.tolist() == [False, False, True, True, False, False]
