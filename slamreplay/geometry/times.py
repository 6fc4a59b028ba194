"""Time is int64 nanoseconds; float seconds occur in text and figures only."""

from __future__ import annotations

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
