"""Do scans and odometry tell their turns at the same time? Delays in seconds, with a sigma.

A scan that is stamped late by d shows the heading the robot had d earlier: laid on the map, its
heading lags behind odometry's by turn rate times d. In each turn the lag is regressed on the turn
rate, beside a constant, a drift and a share of the turn (scale errors of the odometry), none of
which looks like a turn rate. Neither the belief nor hindsight's own smoothing is in it: hindsight
only says where to lay the scan. Which of the two is late needs a third witness: the IMU's turn
rate, or the odometry topic where tf is what is compared.
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
from slamreplay.geometry import se2, se3
from slamreplay.geometry.times import NS_PER_S, ns

#: A turn is faster than this, and is looked at so long before and after.
TURN_RAD_S, AROUND_S = 0.2, 0.8
#: Turn rates are differences of headings over this time.
_RATE_S = 0.16
#: A turn whose rate changes less than this is too even to tell a delay from a drift.
SWING_RAD_S = 0.3
#: At most so many scans are laid on the map: a minute or more of turns.
MOST_SCANS = 500
#: Scans of a turn that the regression needs.
_LEAST = 10
#: Longer delays than this leave the turn that shows them.
LONGEST_S = 0.7
#: A delay is worth a word from this on, where it is so many of its sigmas and so many turns tell.
WORTH_S, SIGMAS, FEWEST_TURNS = 0.03, 4.0, 3
_FLOOR_S = 0.004
#: Headings of odometry and map part by so much within a second, without any delay.
DRIFT_RAD = 0.006

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


@dataclass(frozen=True, eq=False)
class _Heading:
    """A heading over time: (N,) sorted times, unwrapped rad."""

    t_ns: NDArray[np.int64]
    yaw: se2.Array

    def at(self, t_ns: NDArray[np.int64], late_s: float = 0.0) -> se2.Array:
        """Headings `late_s` before times (M,), NaN outside."""
        back = (t_ns - self.t_ns[0]) - ns(late_s)
        return np.asarray(np.interp(back, self.t_ns - self.t_ns[0], self.yaw, np.nan, np.nan))

    def rate(self, t_ns: NDArray[np.int64], late_s: float = 0.0) -> se2.Array:
        """Turn rates in rad/s, the same way."""
        half = _RATE_S / 2.0
        return (self.at(t_ns, late_s - half) - self.at(t_ns, late_s + half)) / _RATE_S


def scan_delay(view: BundleView, hindsight: Hindsight) -> Delay | None:
    """The delay between scans and odometry; None where too few turns tell it.

    Args:
        view: the log.
        hindsight: where to lay the scans.
    """
    scans, odometry = scan_set(view), odometry_track(view)
    if scans is None or odometry is None or len(odometry) < 3:
        return None
    wheels = _Heading(odometry.t_ns, np.unwrap(odometry.xyyaw[:, 2]))
    turns = _turns(scans.t_ns, wheels.rate(scans.t_ns))
    if not turns:
        return None
    rows = np.concatenate(turns)
    seen = _Heading(scans.t_ns[rows], _seen(view, scans, hindsight, rows))
    found = _lag(seen, wheels, turns)
    if found is None:
        return None
    name, witness = _witness(view, wheels)
    if witness is None:
        return Delay(*found, "either")
    scan_lag, wheel_lag = _lag(seen, witness, turns), _own_lag(wheels, witness, turns, scans.t_ns)
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
    found = [part for part in np.split(rows, np.flatnonzero(cut) + 1) if len(part) >= _LEAST]
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
    window = Window(0.1, 0.05, 0.36, 0.03, pull=0.02)
    where = hindsight.track.at(scans.t_ns[rows]).xyyaw
    here = se2.compose(se2.inverse(working.origin_xyyaw), where)
    asked = np.flatnonzero(np.isfinite(here).all(axis=1))
    clouds = [thin(scans.points(row), 0.1) for row in rows[asked].tolist()]
    tops = match_each(field, clouds, here[asked], window)
    near = np.hypot(*(tops.xyyaw - here[asked])[:, :2].T) < 0.3
    fits = near & (tops.score > 0.4) & (np.array([len(c) for c in clouds]) >= 20)
    out[asked[fits]] = tops.xyyaw[fits, 2] + working.origin_xyyaw[2]
    known = np.isfinite(out)
    out[known] = np.unwrap(out[known])
    return out


def _lag(
    seen: _Heading, other: _Heading, turns: list[NDArray[np.int64]]
) -> tuple[float, float, int] | None:
    """By how much `seen` lags behind the other: seconds, sigma, turns; None if nothing tells."""
    edges = np.cumsum([0, *map(len, turns)])
    late, found = 0.0, None
    for _ in range(4):  # a delay of half a turn is not small: go back in time and ask again
        lags = []
        for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            t, y = seen.t_ns[a:b], seen.yaw[a:b]
            lag = _turn_lag(t, y - other.at(t, late), other.at(t, late), other.rate(t, late))
            if lag is not None:
                lags.append(lag)
        if len(lags) < 2:
            return None
        found = _combined(np.array(lags))
        late = float(np.clip(late + found[0], -LONGEST_S, LONGEST_S))
        if abs(found[0]) < 1e-3:
            break
    return None if found is None else (late, found[1], found[2])


def _turn_lag(
    t_ns: NDArray[np.int64], apart: se2.Array, yaw: se2.Array, rate: se2.Array
) -> tuple[float, float] | None:
    """Seconds and their sigma of one turn."""
    ok = np.isfinite(apart) & np.isfinite(rate)
    if ok.sum() < _LEAST or np.ptp(rate[ok]) < SWING_RAD_S:
        return None
    t = (t_ns[ok] - t_ns[ok][0]) / NS_PER_S
    turned = yaw[ok] - yaw[ok].mean()
    columns = np.column_stack([np.ones(len(t)), t - t.mean(), turned, -rate[ok]])
    y = np.unwrap(apart[ok])
    weight = np.ones(len(t))
    for _ in range(3):
        scaled = columns * weight[:, None]
        # A hint of ridge: of a steady turn its share and its time are the same thing.
        normal = scaled.T @ columns + np.diag([1e-9, 1e-9, 1e-2, 1e-6])
        inverse = np.linalg.inv(normal)
        solved = inverse @ (scaled.T @ y)
        rest = y - columns @ solved
        sigma = max(1.4826 * float(np.median(np.abs(rest))), 0.002)
        weight = np.minimum(1.0, 2.0 * sigma / np.maximum(np.abs(rest), 1e-9))
    # What is left is not white: odometry drifts and maps bend over a second. A long even turn,
    # whose turn rate looks like such a drift, gets the large sigma that it deserves.
    row = (inverse @ scaled.T)[3]
    alike = DRIFT_RAD**2 * np.exp(-np.abs(t[:, None] - t[None, :]))
    return float(solved[3]), float(np.sqrt(row @ alike @ row + sigma**2 * (row @ row)))


def _combined(lags: se2.Array) -> tuple[float, float, int]:
    """Mean of the turns' lags (N, 2), robust; its sigma grows where they disagree."""
    lag, sigma = lags[:, 0], np.hypot(lags[:, 1], _FLOOR_S)
    centre = _weighted_median(lag, 1.0 / sigma)
    for _ in range(5):
        off = np.abs(lag - centre) / sigma
        weight = np.minimum(1.0, 2.0 / np.maximum(off, 1e-9)) / sigma**2
        centre = float((weight * lag).sum() / weight.sum())
    off = np.abs(lag - centre) / sigma
    excess = max(1.0, 1.4826 * _weighted_median(off, 1.0 / sigma))
    spread = excess / np.sqrt(weight.sum())
    return centre, float(np.hypot(spread, _FLOOR_S / np.sqrt(len(lag)))), len(lag)


def _weighted_median(values: se2.Array, weights: se2.Array) -> float:
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])


def _own_lag(
    wheels: _Heading, witness: _Heading, turns: list[NDArray[np.int64]], t_ns: NDArray[np.int64]
) -> tuple[float, float, int] | None:
    rows = np.concatenate(turns)
    return _lag(_Heading(t_ns[rows], wheels.at(t_ns[rows])), witness, turns)


def _witness(view: BundleView, wheels: _Heading) -> tuple[str, _Heading | None]:
    """A third heading over time: the IMU's, else the odometry topic's where tf was compared."""
    for name, found in (("IMU", _imu(view)), ("odometry topic", _topic(view))):
        if found is None or len(found.t_ns) < 3:
            continue
        told, own = found.at(wheels.t_ns), wheels.yaw
        both = np.isfinite(told)
        same = both.sum() > 2 and np.allclose(np.diff(told[both]), np.diff(own[both]), atol=1e-6)
        if both.mean() > 0.5 and not (same and name == "odometry topic"):
            return name, found
    return "", None


def _imu(view: BundleView) -> _Heading | None:
    table = view.role("imu")
    if table is None or len(table) < 3:
        return None
    table = table.sorted_by_time()
    t, rate = table.t_ns, table["angular_velocity_xyz"]
    base, frame = view.manifest.frames.base, str(table["frame_id"][0])
    up = np.array([0.0, 0.0, 1.0])
    if base and view.transforms.has_path(base, frame):
        T, known = view.transforms.lookup(base, frame, t[len(t) // 2 : len(t) // 2 + 1])
        up = T[0, 2, :3] if known[0] else up
    about = np.nan_to_num(rate @ up)
    step = np.diff(t) / NS_PER_S
    yaw = np.concatenate([[0.0], np.cumsum(0.5 * (about[1:] + about[:-1]) * step)])
    return _Heading(t, yaw)


def _topic(view: BundleView) -> _Heading | None:
    table = view.role("odometry")
    if table is None or len(table) < 3:
        return None
    table = table.sorted_by_time()
    return _Heading(table.t_ns, np.unwrap(se3.yaw_from_quaternion(table["orientation_xyzw"])))
