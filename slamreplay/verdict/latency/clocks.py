"""Whether header stamps can be subtracted from log times, and how log times are read where not.

An age is a log time minus a stamp: the difference of two clocks is in it. A sensor's delay is its
latency plus that difference, and no latency is negative, so that the least delay of the fastest
sensor bounds the difference. Where the two clocks are not one, the fastest message is taken to have
been recorded at once: all ages are then told from it, and the real ones are longer. So it is with a
single stream whose stamps lie ahead, while others are recorded soon after theirs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from slamreplay.audit.delays import Delays, delays
from slamreplay.audit.streams import Stream
from slamreplay.bundle.manifest import Clock
from slamreplay.geometry.times import NO_STAMP, NS_PER_S, Times

Basis = Literal["shared", "relative", "arrival"]

#: A recorder's clock may lag by rounding; a stream farther ahead of it is of another clock.
_AHEAD_S = 0.005
#: Delays beyond this are another clock's; those beyond the other are worth a word.
_ANOTHER_S, _SLOW_S = 1.0, 0.05
#: Log times that are the stamps themselves, in so many of the messages.
_COPIED = 0.99


@dataclass(frozen=True)
class Clocks:
    """How log times become comparable with stamps.

    Attributes:
        basis: `shared`, both are of one clock, ages are absolute; `relative`, ages are told from
            the fastest message and the real ones are longer by what that one took; `arrival`,
            nothing tells how long messages took, ages count from their arrival on.
        caveats: what the reader of ages has to know, one sentence each.
        clock: the bundle's.
        early_ns: taken off log times that were carried over to the stamps' clock.
        ahead_ns: by name of the stream, how far its stamps lie ahead of all others'.
    """

    basis: Basis
    caveats: tuple[str, ...]
    clock: Clock
    early_ns: int = 0
    ahead_ns: Mapping[str, int] = field(default_factory=dict)

    def arrived_ns(self, t_log_ns: Times) -> Times:
        """(N,) when messages with log times (N,) were there, on the clock of the stamps."""
        if self.basis == "shared":
            return t_log_ns
        return np.asarray(self.clock.from_log_time(t_log_ns) - self.early_ns)

    def stamped_ns(self, stream: Stream) -> Times:
        """(N,) usable stamps of a stream on the clock of the others, NO_STAMP for the rest."""
        stamps = usable_stamps(stream)
        ahead = self.ahead_ns.get(stream.name, 0)
        return np.where(stamps == NO_STAMP, NO_STAMP, stamps - ahead)


def usable_stamps(stream: Stream) -> Times:
    """(N,) stamps that the bundle's own time rests on, NO_STAMP for all others."""
    kept = stream.stamped & (stream.t_ns == stream.t_sensor_ns)
    return np.where(kept, stream.t_sensor_ns, NO_STAMP)


def clocks_of(sensors: Sequence[Stream], clock: Clock, *, simulated: bool = False) -> Clocks:
    """How the log times of a log compare with its stamps.

    Args:
        sensors: streams of measurements, odometry on tf among them.
        clock: the bundle's.
        simulated: whether the log has /clock: time that may run at another pace.
    """
    stamps = [usable_stamps(s) for s in sensors]
    asked = [(s, t) for s, t in zip(sensors, stamps, strict=True) if (t != NO_STAMP).any()]
    if not asked or clock.name == "log":
        return Clocks("arrival", ("no header stamps: ages count from a message's arrival",), clock)
    if all(_is_copied(s, t) for s, t in asked):
        why = "log times are the header stamps themselves: how long messages took is not told"
        return Clocks("arrival", (why,), clock)
    raw = {s.name: late for s, t in asked if (late := delays(s.t_log_ns, t)) is not None}
    fastest = min(raw.values(), key=lambda d: d.least_s)
    # One stream may be ahead of the clock; not if the only other ones are late.
    most_s = _SLOW_S if fastest.least_s < -_AHEAD_S else _ANOTHER_S
    sound = [d for d in raw.values() if -_AHEAD_S <= d.least_s <= most_s and _is_steady(d)]
    if sound:
        ahead = {n: -d.least_s for n, d in raw.items() if -_ANOTHER_S < d.least_s < -_AHEAD_S}
        caveats = [
            f"stamps of {name} lie {1e3 * lead:.0f} ms ahead of the log times: their ages are told "
            "from their own fastest message on"
            for name, lead in ahead.items()
        ]
        least = min(d.least_s for d in sound)
        if least > _SLOW_S:
            caveats.append(
                f"even the fastest sensor is recorded {1e3 * least:.0f} ms after its stamp: "
                "latency, or a difference of two clocks"
            )
        leads = {name: round(lead * NS_PER_S) for name, lead in ahead.items()}
        return Clocks("shared", tuple(caveats), clock, ahead_ns=leads)
    why = "stamps and log times are of two clocks"
    if abs(fastest.least_s) < _ANOTHER_S and _is_steady(fastest):
        why = f"stamps lie {-1e3 * fastest.least_s:.0f} ms ahead of the log times"
    elif simulated or "simulated" in clock.reason:
        why = "stamps are simulated time, log times are not"
    text = f"{why}: ages are told from the fastest message on, the real ones are longer"
    carried = [delays(clock.from_log_time(s.t_log_ns), t) for s, t in asked]
    early_s = min(d.least_s for d in carried if d is not None)
    return Clocks("relative", (text,), clock, round(early_s * NS_PER_S))


def _is_steady(late: Delays) -> bool:
    """Whether the difference of the two clocks stayed what it was."""
    return late.drift_ppm is None and not late.jumps


def _is_copied(stream: Stream, stamps: Times) -> bool:
    stamped: NDArray[np.bool_] = stamps != NO_STAMP
    return float((stamps == stream.t_log_ns)[stamped].mean()) > _COPIED
