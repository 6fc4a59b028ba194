"""How long after their stamps messages were recorded: offset, drift, jumps, stamps of the future.

A delay is the difference of two clocks plus how long the message was on its way, and only the
second can but grow: of each stretch the least delay is nearest to the clocks' own difference.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.geometry.se2 import Array
from slamreplay.geometry.times import NO_STAMP, NS_PER_S, Times

#: Windows the log is cut into, and the messages each needs.
_WINDOWS, _PER_WINDOW = 30, 10
#: A drift needs so many windows over so many seconds, and must be so many of its sigmas.
_FEWEST_WINDOWS, _SHORTEST_S, _SIGMAS = 6, 10.0, 4.0
#: Delays that change by less over the log are within the resolution of stamps and recorders.
_LEAST_DRIFT_S = 0.002
#: Nor is one that is less than so many times the jitter of the delays told from them.
_LEAST_JITTERS = 5.0
#: A step of this size, or of so many of the usual ones, may be a jump: if the level stays.
LEAST_JUMP_S, _USUAL_STEPS = 0.03, 8.0
#: The level before and after is read over so long, over no less, and from so many messages.
_LEVEL_S, _LEAST_LEVEL_S, _LEVEL_ROWS, _LOW = 3.0, 0.5, 5, 0.1
#: A recorder that stalls raises delays for some seconds: a raised level must last as long as this.
_LASTS_S = 30.0
#: Share of a change of level that one single step has to bring, and that must last.
_IN_ONE, _KEPT = 0.65, 0.5
#: Stamps later than the log time: all of them by this much, or some by that, beyond the jitter.
_LEAD_S, _AHEAD_S, _JITTERS = 0.005, 0.02, 3.0


@dataclass(frozen=True)
class Jump:
    """Stamps that moved against the log time at one message and stayed there.

    Attributes:
        t_log_ns: log time of the first message after it.
        seconds: by how much stamps went ahead; negative where they fell back.
        gap_s: log time since the message before.
    """

    t_log_ns: int
    seconds: float
    gap_s: float


@dataclass(frozen=True)
class Delays:
    """Log time minus stamp, in s, of the N stamped messages of a stream.

    Attributes:
        median_s: the typical one.
        p95_s: 95 of 100 are smaller.
        least_s: the smallest, but for one in a hundred.
        jitter_s: robust standard deviation of the early side, drift and jumps taken out.
        drift_ppm: by how much the log's clock runs faster than the stamps', in millionths of the
            log's time; None where that is not more than noise.
        drift_s: what the drift makes of the whole stream.
        jumps: changes of level that one message brought, in order.
        ahead: messages whose stamp is later than their log time by more than jitter explains.
        n: messages.
    """

    median_s: float
    p95_s: float
    least_s: float
    jitter_s: float
    drift_ppm: float | None
    drift_s: float | None
    jumps: tuple[Jump, ...]
    ahead: int
    n: int

    @property
    def lead_s(self) -> float | None:
        """How far all stamps lie ahead of the log times, None where they do not."""
        ahead = -self.median_s
        return ahead if ahead > max(_LEAD_S, _JITTERS * self.jitter_s) else None


def delays(t_log_ns: Times, t_sensor_ns: Times) -> Delays | None:
    """The delays of messages (N,) in the order of their log times; None where none has a stamp."""
    stamped = t_sensor_ns != NO_STAMP
    t_log, late = t_log_ns[stamped], (t_log_ns - np.where(stamped, t_sensor_ns, 0))[stamped]
    if not len(late):
        return None
    middle = int(np.median(late))
    x, d = (t_log - t_log[0]) / NS_PER_S, (late - middle) / NS_PER_S
    slope = _pace(x, d)
    level = d - slope * x
    found = _jumps(x, level)
    for row, change in found:
        level[row:] -= change
    rest, sigma = _theil_sen(*_least(x, level))
    slope += rest
    level = level - rest * x
    jitter = float((np.median(level) - np.percentile(level, 5)) / 1.645)
    span = float(x[-1])
    worth = max(_LEAST_DRIFT_S, _SIGMAS * sigma * span, _LEAST_JITTERS * jitter)
    told = span >= _SHORTEST_S and abs(slope) * span > worth
    offset = middle / NS_PER_S
    return Delays(
        median_s=offset,
        p95_s=offset + float(np.percentile(d, 95)),
        least_s=offset + float(np.percentile(d, 1)),
        jitter_s=jitter,
        drift_ppm=1e6 * slope if told else None,
        drift_s=slope * span if told else None,
        jumps=tuple(
            Jump(int(t_log[row]), -change, float(x[row] - x[row - 1])) for row, change in found
        ),
        ahead=int(np.count_nonzero(late < -NS_PER_S * max(_AHEAD_S, _JITTERS * jitter))),
        n=len(late),
    )


def _least(x: Array, d: Array) -> tuple[Array, Array]:
    """When and how small the least delay was, window by window (K,)."""
    count = int(min(_WINDOWS, len(x) // _PER_WINDOW))
    if count < 2 or x[-1] <= 0.0:
        return np.zeros(1), np.zeros(1)
    window = np.minimum((x / x[-1] * count).astype(np.int64), count - 1)
    starts = np.flatnonzero(np.append(True, window[1:] != window[:-1]))
    sizes = np.diff(np.append(starts, len(x)))
    low = np.minimum.reduceat(d, starts)
    first = starts + np.array(
        [int(np.argmin(d[a : a + n])) for a, n in zip(starts, sizes, strict=True)]
    )
    enough = sizes >= _PER_WINDOW // 2
    return x[first][enough], low[enough]


def _pace(x: Array, d: Array) -> float:
    """A slope that a few jumps do not bend: the median of those between neighbouring windows."""
    at, low = _least(x, d)
    step = np.diff(at)
    slopes = np.diff(low)[step > 0.0] / step[step > 0.0]
    return float(np.median(slopes)) if len(slopes) >= _FEWEST_WINDOWS - 1 else 0.0


def _theil_sen(x: Array, y: Array) -> tuple[float, float]:
    """Median of the slopes between all pairs of points (K,), and its standard deviation."""
    if len(x) < _FEWEST_WINDOWS:
        return 0.0, np.inf
    i, j = np.triu_indices(len(x), 1)
    apart = x[j] - x[i]
    slope = float(np.median((y[j] - y[i])[apart > 0.0] / apart[apart > 0.0]))
    rest = y - slope * x
    spread = 1.4826 * float(np.median(np.abs(rest - np.median(rest))))
    # Of a straight line through K evenly spaced points.
    return slope, spread * float(np.sqrt(12.0 / len(x))) / max(float(np.ptp(x)), 1e-9)


def _jumps(x: Array, d: Array) -> list[tuple[int, float]]:
    """Rows at which the level of delays (N,) changed for good, and by how much in s."""
    if len(x) < 2 * _LEVEL_ROWS:
        return []
    d, step = d.copy(), np.diff(d)
    least = max(LEAST_JUMP_S, _USUAL_STEPS * 1.4826 * float(np.median(np.abs(step))))
    found: list[tuple[int, float]] = []
    for row in (np.flatnonzero(np.abs(step) > least) + 1).tolist():
        before, after = _level(x, d, row, -_LEVEL_S), _level(x, d, row, _LEVEL_S)
        change = after - before
        if not abs(change) > least or abs(change - step[row - 1]) > (1 - _IN_ONE) * abs(change):
            continue
        if change > 0.0:
            lasting = _level(x, d, row, _LASTS_S) - before
        else:
            lasting = after - _level(x, d, row, -_LASTS_S)
        if lasting / change > _KEPT:
            found.append((row, change))
            d[row:] -= change
    return found


def _level(x: Array, d: Array, row: int, seconds: float) -> float:
    """A low delay so long before a row (negative) or from it on; NaN where that is no span.

    Not the least of all: a single stamp that is too early makes no level.
    """
    edge = int(np.searchsorted(x, x[row] + seconds))
    low, high = (edge, row) if seconds < 0.0 else (row, edge)
    if high - low < _LEVEL_ROWS or x[high - 1] - x[low] < _LEAST_LEVEL_S:
        return float("nan")
    return float(np.quantile(d[low:high], _LOW))
