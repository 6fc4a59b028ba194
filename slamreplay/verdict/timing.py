"""Do scans and odometry tell their turns at the same time? Delays in seconds, with a sigma.

A scan that is stamped late by d shows the heading the robot had d earlier: laid on the map, its
heading lags behind odometry's by turn rate times d. Neither the belief nor hindsight's own
smoothing is in it: hindsight only says where to lay the scan. Which of the two is late needs a
third witness: the IMU's turn rate, or the odometry topic where tf is what is compared.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.products import Hindsight
from slamreplay.bundle.scans import ScanSet, scan_set
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S, ns
from slamreplay.verdict.headings import Heading, third_witness
from slamreplay.verdict.turn_lag import LEAST_SCANS, pooled_lag

#: A turn is faster than this, and is looked at so long before and after.
TURN_RAD_S, AROUND_S = 0.2, 0.8
#: At most so many scans are laid on the map: a minute or more of turns.
MOST_SCANS = 500
#: A delay is worth a word from this on, where it is so many of its sigmas and so many turns tell.
WORTH_S, SIGMAS, FEWEST_TURNS = 0.03, 4.0, 3

Late = Literal["scans", "odometry", "either"]


@dataclass(frozen=True)
class Delay:
    """How much later scans are stamped than odometry.

    Attributes:
        seconds: positive where scans carry too late stamps against odometry, negative where
            odometry (or its tf) does against scans.
        sigma_s: standard deviation of it, from how far the turns agree among each other.
        turns: turns that tell it.
        late: who is late, as a third witness says; either where there is none.
        witness: the IMU or the odometry topic, empty without one.
    """

    seconds: float
    sigma_s: float
    turns: int
    late: Late
    witness: str = ""

    @property
    def is_significant(self) -> bool:
        """Whether it is more than noise and large enough for a word."""
        far = abs(self.seconds) >= max(WORTH_S, SIGMAS * self.sigma_s)
        return far and self.turns >= FEWEST_TURNS

    @property
    def text(self) -> str:
        """The delay in words."""
        size = f"{1e3 * abs(self.seconds):.0f} ms (sigma {1e3 * self.sigma_s:.0f} ms)"
        first, other = ("scans", "odometry") if self.seconds > 0 else ("odometry", "scans")
        by = f"; the {self.witness} agrees with the {other}" if self.late != "either" else ""
        return f"{first} are stamped {size} late against {other}, by {self.turns} turns{by}"


def scan_delay(view: BundleView, hindsight: Hindsight) -> Delay | None:
    """The delay between scans and odometry; None where too few turns tell it.

    Args:
        view: the log.
        hindsight: where to lay the scans.
    """
    scans, odometry = scan_set(view), odometry_track(view)
    if scans is None or odometry is None or len(odometry) < 3:
        return None
    wheels = Heading(odometry.t_ns, np.unwrap(odometry.xyyaw[:, 2]))
    turns = _turns(scans.t_ns, wheels.rate(scans.t_ns))
    if not turns:
        return None
    rows = np.concatenate(turns)
    seen = Heading(scans.t_ns[rows], _seen(view, scans, hindsight, rows))
    found = pooled_lag(seen, wheels, turns)
    if found is None:
        return None
    name, witness = third_witness(view, wheels)
    if witness is None:
        return Delay(*found, "either")
    scan_lag, wheel_lag = (
        pooled_lag(seen, witness, turns),
        _own_lag(wheels, witness, turns, scans.t_ns),
    )
    if scan_lag is None or wheel_lag is None:
        return Delay(*found, "either")
    late: Late = "scans" if abs(scan_lag[0]) > abs(wheel_lag[0]) else "odometry"
    if min(abs(scan_lag[0]), abs(wheel_lag[0])) > 0.5 * abs(found[0]):
        late = "either"
    agrees = late == "either" or (late == "scans") == (found[0] > 0)
    return Delay(*found, late if agrees else "either", name)


def _turns(t_ns: NDArray[np.int64], rate: se2.Array) -> list[NDArray[np.int64]]:
    """Rows of the scans in and around each turn; evenly thinned out where there are very many."""
    fast = np.flatnonzero(np.abs(np.nan_to_num(rate)) > TURN_RAD_S)
    if not len(fast):
        return []
    near = np.zeros(len(t_ns), dtype=bool)
    low = np.searchsorted(t_ns, t_ns[fast] - ns(AROUND_S))
    high = np.searchsorted(t_ns, t_ns[fast] + ns(AROUND_S))
    for a, b in zip(low.tolist(), high.tolist(), strict=True):
        near[a:b] = True
    rows = np.flatnonzero(near)
    cut = (np.diff(rows) > 1) | (np.diff(t_ns[rows]) > NS_PER_S // 2)
    found = [part for part in np.split(rows, np.flatnonzero(cut) + 1) if len(part) >= LEAST_SCANS]
    pieces = [p for part in found for p in np.array_split(part, max(1, len(part) // 60))]
    every = int(np.ceil(sum(map(len, pieces)) / MOST_SCANS)) if pieces else 1
    return pieces[::every]


def _seen(
    view: BundleView, scans: ScanSet, hindsight: Hindsight, rows: NDArray[np.int64]
) -> se2.Array:
    """(M,) headings at which the scans fit the map best, unwrapped; NaN where they fit nowhere."""
    from slamreplay.matching.correlative import Window, match_each
    from slamreplay.matching.field import working_map
    from slamreplay.matching.thinning import thin

    working = None if view.grid is None else working_map(view.grid)
    out = np.full(len(rows), np.nan)
    if working is None:
        return out
    field = working.field(0.12)
    # 0.36 rad is what a turn of 0.5 rad/s makes of the longest delay.
    window = Window(0.1, 0.05, 0.36, 0.03, pull=0.02)
    where = hindsight.track.at(scans.t_ns[rows]).xyyaw
    here = se2.compose(se2.inverse(working.origin_xyyaw), where)
    asked = np.flatnonzero(np.isfinite(here).all(axis=1))
    clouds = [thin(scans.points(row), 0.1) for row in rows[asked].tolist()]
    tops = match_each(field, clouds, here[asked], window)
    # A match elsewhere, a poor one or one of few points says nothing of the heading.
    near = np.hypot(*(tops.xyyaw - here[asked])[:, :2].T) < 0.3
    fits = near & (tops.score > 0.4) & (np.array([len(c) for c in clouds]) >= 20)
    out[asked[fits]] = tops.xyyaw[fits, 2] + working.origin_xyyaw[2]
    known = np.isfinite(out)
    out[known] = np.unwrap(out[known])
    return out


def _own_lag(
    wheels: Heading, witness: Heading, turns: list[NDArray[np.int64]], t_ns: NDArray[np.int64]
) -> tuple[float, float, int] | None:
    rows = np.concatenate(turns)
    return pooled_lag(Heading(t_ns[rows], wheels.at(t_ns[rows])), witness, turns)
