"""Time is int64 nanoseconds; float seconds occur in text and figures only."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from decimal import Decimal

import numpy as np
from numpy.typing import ArrayLike, NDArray

NS_PER_S = 1_000_000_000
#: A row whose message carries no header stamp (or a zero one). Parquet holds null for it.
NO_STAMP = np.iinfo(np.int64).min

Times = NDArray[np.int64]


def stamp_ns(sec: ArrayLike, nanosec: ArrayLike) -> Times:
    """Nanoseconds of ROS stamps; widened first, for int32 seconds times 1e9 wrap in silence."""
    return np.asarray(sec, dtype=np.int64) * NS_PER_S + np.asarray(nanosec, dtype=np.int64)


def ns(seconds: float) -> int:
    """A duration in seconds as whole nanoseconds."""
    return round(seconds * NS_PER_S)


def seconds_since(t_ns: ArrayLike, start_ns: int) -> NDArray[np.float64]:
    """Seconds after `start_ns`: the subtraction is exact, the float is small."""
    return (np.asarray(t_ns, dtype=np.int64) - start_ns) / NS_PER_S


def decimal_seconds(t_ns: int) -> str:
    """Seconds with nine decimals, by integer arithmetic: a float would lose nanoseconds."""
    sign, whole = ("-", -t_ns) if t_ns < 0 else ("", t_ns)
    return f"{sign}{whole // NS_PER_S}.{whole % NS_PER_S:09d}"


def from_decimal_seconds(texts: Sequence[bytes]) -> tuple[Times, NDArray[np.bool_]]:
    """Nanoseconds (N,) of seconds as text, exact to the last digit, and the mask of real times.

    A text that is no number, not finite, or beyond int64 nanoseconds gives 0 and False.
    """
    t_ns, is_time = np.zeros(len(texts), dtype=np.int64), np.zeros(len(texts), dtype=bool)
    if not len(texts):
        return t_ns, is_time
    whole, _, fraction = np.char.partition(np.array(texts, dtype=np.bytes_), b".").T
    digits = np.char.str_len(fraction)
    usual = np.char.isdigit(whole) & (np.char.str_len(whole) <= 10) & (digits <= 9)
    usual &= np.char.isdigit(fraction) | (digits == 0)
    seconds = np.where(usual, whole, b"0").astype(np.int64)
    usual &= seconds < np.iinfo(np.int64).max // NS_PER_S
    padded = np.char.ljust(np.where(usual, fraction, b""), 9, b"0").astype("S9")
    t_ns[usual] = seconds[usual] * NS_PER_S + padded[usual].astype(np.int64)
    is_time |= usual
    for row in np.flatnonzero(~usual).tolist():
        try:
            value = (Decimal(texts[row].decode("ascii")) * NS_PER_S).to_integral_value()
        except (ArithmeticError, UnicodeDecodeError):
            continue
        if value.is_finite() and abs(value) <= np.iinfo(np.int64).max:
            t_ns[row], is_time[row] = int(value), True
    return t_ns, is_time


def in_order(t_ns: Times) -> tuple[Times, NDArray[np.bool_]]:
    """Times (N,) that never step back from row to row, and the mask of those that were moved.

    The fewest rows are moved (all but a longest subsequence that never steps back), each to its
    share of the way between its neighbours that stay.
    """
    moved = np.zeros(len(t_ns), dtype=bool)
    if len(t_ns) < 2 or (np.diff(t_ns) >= 0).all():
        return t_ns, moved
    ends: list[int] = []  # the least end of such a subsequence of each length
    rows: list[int] = []
    before = np.full(len(t_ns), -1, dtype=np.int64)
    for row, t in enumerate(t_ns.tolist()):
        at = bisect_right(ends, t)
        before[row] = rows[at - 1] if at else -1
        ends[at : at + 1], rows[at : at + 1] = [t], [row]
    stays = np.zeros(len(t_ns), dtype=bool)
    row = rows[-1]
    while row >= 0:
        stays[row] = True
        row = int(before[row])
    kept = np.flatnonzero(stays)
    first = t_ns[kept[0]]  # differences are small, so that float64 holds them to the nanosecond
    between = np.interp(np.arange(len(t_ns)), kept, (t_ns[kept] - first).astype(np.float64))
    return np.where(stays, t_ns, first + np.rint(between).astype(np.int64)), ~stays
