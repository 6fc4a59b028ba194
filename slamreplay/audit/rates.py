"""How regularly a stream comes: its period and jitter, gaps against its own rate, odd stamps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slamreplay.geometry.times import NO_STAMP, NS_PER_S, Times

#: A stream whose intervals scatter by more than this part of its period comes when it comes.
_REGULAR, _FEWEST = 0.35, 20
#: So many periods, and at least so long, without a message are a gap.
GAP_PERIODS, GAP_S = 5.0, 0.25
#: From here on an interval is one in which a message is missing.
_MISSING = 1.5


@dataclass(frozen=True)
class Gap:
    """A stretch without messages, on the bundle's clock, and how many would have come in it."""

    start_ns: int
    end_ns: int
    missing: int

    @property
    def seconds(self) -> float:
        """How long it was."""
        return (self.end_ns - self.start_ns) / NS_PER_S


@dataclass(frozen=True)
class Rate:
    """The rhythm of a stream.

    Attributes:
        period_s: median interval, None with fewer than two messages.
        jitter_s: robust standard deviation of the intervals.
        late_start_s: how long after the log's start the first one came.
        early_end_s: how long before the log's end the last one came.
        is_regular: whether messages come at a rate; only then gaps and missing ones mean anything.
        gaps: longest first.
        missing: messages that would have come, in gaps and elsewhere.
    """

    period_s: float | None
    jitter_s: float | None
    late_start_s: float
    early_end_s: float
    is_regular: bool = False
    gaps: tuple[Gap, ...] = ()
    missing: int = 0


def rate(t_ns: Times, start_ns: int, end_ns: int) -> Rate:
    """The rhythm of messages at times (N,) of a log from `start_ns` to `end_ns`."""
    t = np.sort(t_ns, kind="stable")
    t = t[np.append(t[1:] != t[:-1], True)] if len(t) else t
    late = max(int(t[0]) - start_ns, 0) / NS_PER_S if len(t) else 0.0
    early = max(end_ns - int(t[-1]), 0) / NS_PER_S if len(t) else 0.0
    if len(t) < 2:
        return Rate(None, None, late_start_s=late, early_end_s=early)
    step = np.diff(t) / NS_PER_S
    period = float(np.median(step))
    jitter = 1.4826 * float(np.median(np.abs(step - period)))
    if len(t) < _FEWEST or jitter > _REGULAR * period:
        return Rate(period, jitter, late_start_s=late, early_end_s=early)
    # A missing message shows only beyond what the jitter makes of two neighbouring intervals.
    lacking = np.rint(step / period).astype(np.int64) - 1
    lacking[step < max(_MISSING, 1.0 + 4.0 * jitter / period) * period] = 0
    wide = np.flatnonzero(step > max(GAP_PERIODS * period, GAP_S))
    wide = wide[(t[wide + 1] > start_ns) & (t[wide] < end_ns)]  # a latched one came long before
    wide = wide[np.argsort(-step[wide], kind="stable")]
    gaps = tuple(Gap(int(t[k]), int(t[k + 1]), int(lacking[k])) for k in wide)
    missing = int(lacking.sum())
    return Rate(period, jitter, late, early, is_regular=True, gaps=gaps, missing=missing)


@dataclass(frozen=True)
class OddStamps:
    """Stamps of a stream that cannot be right, counted in the order of its log times.

    Attributes:
        zero: messages without a stamp.
        repeated: messages with the stamp of the one before.
        backwards: messages stamped earlier than the one before; by `back_s` at the most.
    """

    zero: int
    repeated: int
    backwards: int
    back_s: float


def odd_stamps(t_sensor_ns: Times) -> OddStamps:
    """What is odd about stamps (N,), NO_STAMP where there is none."""
    stamped = t_sensor_ns != NO_STAMP
    step = np.diff(t_sensor_ns[stamped])
    back = float(-step.min()) / NS_PER_S if len(step) and step.min() < 0 else 0.0
    return OddStamps(
        zero=int(np.count_nonzero(~stamped)),
        repeated=int(np.count_nonzero(step == 0)),
        backwards=int(np.count_nonzero(step < 0)),
        back_s=back,
    )
