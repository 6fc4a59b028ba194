"""Which messages never came."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slamreplay.errors import NotApplicableError
from slamreplay.geometry.times import Times, ns


def lost_at_random(t_ns: Times, ratio: float, rng: np.random.Generator) -> NDArray[np.bool_]:
    """(N,) each message is lost with this probability; a higher one loses the same and more.

    Messages of one time are one: a driver that tells a thing in two ways tells neither.
    """
    _, which = np.unique(t_ns, return_inverse=True)
    return np.asarray(rng.random(int(which.max(initial=-1)) + 1)[which] < ratio)


def lost_in_a_burst(
    t_ns: Times, burst_s: float, rng: np.random.Generator, name: str
) -> NDArray[np.bool_]:
    """(N,) all that came within so long of a moment; a longer burst contains the shorter one.

    Args:
        t_ns: (N,) times, in any order.
        burst_s: how long, s.
        rng: chooses the moment.
        name: of the perturbation that asks.

    Raises:
        NotApplicableError: the messages span less.
    """
    span = int(np.ptp(t_ns)) if len(t_ns) else 0
    spare = span - ns(burst_s)
    if spare < 0:
        raise NotApplicableError(f"the log is shorter than {burst_s:g} s", where=name)
    start = t_ns.min() + int(rng.random() * spare)
    return np.asarray((t_ns >= start) & (t_ns < start + ns(burst_s)))
