"""Odometry against hindsight: its scale, its pull to one side, and where its wheels lost grip.

Motions over one second, robot forward and turn, are laid beside each other. What holds for the
whole log is a matter of calibration (scale of way and of turn, pull per metre: the differential
drive's systematic errors after Borenstein and Feng, 1996); what sticks out for a while is a slip.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.odometry import odometry_track
from slamreplay.bundle.view import BundleView
from slamreplay.geometry import se2
from slamreplay.geometry.times import NS_PER_S
from slamreplay.verdict.belief_error import BeliefError
from slamreplay.verdict.motion import runs

#: Motions are compared over this time.
STEP_NS = NS_PER_S
#: A second in which they differ by more than this, calibration apart, is one of slip.
SLIP_M, SLIP_RAD = 0.15, np.radians(6.0)
#: Such seconds this near to each other are one slip; it counts from this total on.
NEAR_NS, LEAST_M, LEAST_RAD = 2 * NS_PER_S, 0.25, np.radians(8.0)
#: Calibration errors are worth a word from here on.
SCALE_WORTH, PULL_WORTH_RAD_M = 0.03, np.radians(1.0)
#: From here on they are a fault of the robot even where its localizer coped.
SCALE_GROSS, PULL_GROSS_RAD_M = 0.15, np.radians(4.0)
#: A robot that moved by half a metre while its wheels turned a quarter of that was carried.
CARRIED_M, CARRIED_SHARE = 0.5, 0.25

Model = Literal["spinning", "sliding", "sideways", "turning", "carried"]

_MODELS: dict[Model, str] = {
    "spinning": "translational slip, the wheels turned more than the robot moved",
    "sliding": "translational slip, the robot moved farther than its wheels turned",
    "sideways": "sideways slip, which wheels cannot count",
    "turning": "rotational slip, the robot turned otherwise than its wheels",
    "carried": "no slip: it moved while its wheels stood still",
}


@dataclass(frozen=True)
class WheelSlip:
    """One stretch in which odometry and hindsight moved otherwise.

    Attributes:
        start_ns: when it began.
        end_ns: when it ended.
        metres: by how much the two differ over it.
        radians: the same in heading, signed: hindsight minus odometry.
        moved_m: how far the robot moved, along its way.
        counted_m: how far its wheels say.
        model: what kind it is.
    """

    start_ns: int
    end_ns: int
    metres: float
    radians: float
    moved_m: float
    counted_m: float
    model: Model

    def text(self, start_ns: int) -> str:
        """In words; times count from `start_ns`."""
        since, until = ((t - start_ns) / NS_PER_S for t in (self.start_ns, self.end_ns))
        return (
            f"{_MODELS[self.model]}: from {since:.1f} s to {until:.1f} s it moved "
            f"{self.moved_m:.2f} m where its wheels say {self.counted_m:.2f} m, "
            f"{self.metres:.2f} m and {np.degrees(abs(self.radians)):.0f} deg apart"
        )


@dataclass(frozen=True)
class Wheels:
    """What is wrong with the odometry all along, and where it slipped.

    Attributes:
        scale: way it counts for one metre, None where it drove too little to tell.
        scale_sigma: standard deviation of it.
        turn_scale: turn it counts for one radian, None where it turned too little.
        turn_sigma: standard deviation of it.
        pull_rad_m: rad it turns too much per metre of way.
        slips: in time order.
    """

    scale: float | None
    scale_sigma: float | None
    turn_scale: float | None
    turn_sigma: float | None
    pull_rad_m: float | None
    slips: tuple[WheelSlip, ...]

    @property
    def is_gross(self) -> bool:
        """Whether odometry is off by more than wheels that are merely worn."""
        scales = ((self.scale, self.scale_sigma), (self.turn_scale, self.turn_sigma))
        pull = self.pull_rad_m
        return (pull is not None and abs(pull) > PULL_GROSS_RAD_M) or any(
            value is not None
            and sigma is not None
            and abs(value - 1.0) > max(SCALE_GROSS, 4.0 * sigma)
            for value, sigma in scales
        )

    def mended(self, odometry: se2.Array) -> se2.Array:
        """Odometry (N, 3) with its scales and its pull taken out where they are beyond noise.

        What is left of a difference to where the robot was is an event. NaN rows stay.
        """
        out = np.full_like(odometry, np.nan)
        rows = np.flatnonzero(np.isfinite(odometry).all(axis=1))
        if not len(rows):
            return out
        way = 1.0 if self.scale is None else _sure((self.scale, self.scale_sigma or 0.0))
        turn = 1.0 if self.turn_scale is None else _sure((self.turn_scale, self.turn_sigma or 0.0))
        pull = self.pull_rad_m or 0.0
        pull = pull if abs(pull) > PULL_WORTH_RAD_M else 0.0
        told = odometry[rows]
        steps = se2.between(told[:-1], told[1:])
        steps[:, :2] /= way
        steps[:, 2] = se2.wrap_angle(steps[:, 2]) / turn - pull * steps[:, 0]
        yaw = told[0, 2] + np.concatenate([[0.0], np.cumsum(steps[:, 2])])
        cos, sin = np.cos(yaw[:-1]), np.sin(yaw[:-1])
        dx = cos * steps[:, 0] - sin * steps[:, 1]
        dy = sin * steps[:, 0] + cos * steps[:, 1]
        out[rows, 0] = told[0, 0] + np.concatenate([[0.0], np.cumsum(dx)])
        out[rows, 1] = told[0, 1] + np.concatenate([[0.0], np.cumsum(dy)])
        out[rows, 2] = se2.wrap_angle(yaw)
        return out

    @property
    def calibration_words(self) -> tuple[str, ...]:
        """Systematic errors worth a word: four sigmas and more."""
        words = []
        for name, value, sigma in (
            ("way", self.scale, self.scale_sigma),
            ("turn", self.turn_scale, self.turn_sigma),
        ):
            if value is None or sigma is None:
                continue
            if abs(value - 1.0) > max(SCALE_WORTH, 4.0 * sigma):
                percent = 100.0 * (value - 1.0)
                words.append(
                    f"wheel scale: odometry counts {abs(percent):.1f} % too "
                    f"{'much' if percent > 0 else 'little'} {name} (sigma {100 * sigma:.1f} %)"
                )
        if self.pull_rad_m is not None and abs(self.pull_rad_m) > PULL_WORTH_RAD_M:
            words.append(
                f"unequal wheels: odometry turns {np.degrees(self.pull_rad_m):+.1f} deg per metre "
                "that the robot does not"
            )
        return tuple(words)


def wheels(view: BundleView, error: BeliefError) -> Wheels | None:
    """Odometry against hindsight at the rows of `error`; None without odometry."""
    odometry = odometry_track(view)
    if odometry is None or len(odometry) < 2:
        return None
    odom = odometry.at(error.t_ns).xyyaw
    rows = np.flatnonzero(error.known & np.isfinite(odom).all(axis=1))
    if len(rows) < 10:
        return None
    t, told, made = error.t_ns[rows], odom[rows], error.where[rows]
    ahead = np.searchsorted(t, t + STEP_NS)
    keep = (ahead < len(t)) & (t[np.minimum(ahead, len(t) - 1)] - t <= 2 * STEP_NS)
    first, last = np.flatnonzero(keep), ahead[keep]
    if len(first) < 5:
        return None
    counted, moved = se2.between(told[first], told[last]), se2.between(made[first], made[last])
    scale = _slope(counted[:, 0], moved[:, 0], least=0.2)
    turn = _slope(counted[:, 2], moved[:, 2], least=0.15)
    pull = _pull(counted, moved, 1.0 if turn is None else turn[0])
    mended = counted / np.array([_sure(scale), 1.0, _sure(turn)])
    apart = moved - mended
    off = (np.hypot(apart[:, 0], apart[:, 1]) > SLIP_M) | (
        np.abs(se2.wrap_angle(apart[:, 2])) > SLIP_RAD
    )
    slips = _slips(t, told, made, first, last, off)
    way, way_sigma = scale or (None, None)
    turns, turn_sigma = turn or (None, None)
    return Wheels(way, way_sigma, turns, turn_sigma, pull, slips)


def _slope(counted: se2.Array, moved: se2.Array, *, least: float) -> tuple[float, float] | None:
    """Median of counted over moved with its sigma, over the seconds that moved at all."""
    rows = (np.abs(moved) > least) & (np.abs(counted) > 0.25 * least)
    if rows.sum() < 30:
        return None
    ratio = counted[rows] / moved[rows]
    centre = float(np.median(ratio))
    spread = 1.4826 * float(np.median(np.abs(ratio - centre)))
    # Seconds that overlap are not independent: about one in ten counts.
    return centre, float(1.25 * spread / np.sqrt(max(rows.sum() / 10.0, 1.0)) + 0.002)


def _sure(slope: tuple[float, float] | None) -> float:
    """A scale to be taken out; one where it is within its noise."""
    return slope[0] if slope is not None and abs(slope[0] - 1.0) > 4.0 * slope[1] else 1.0


def _pull(counted: se2.Array, moved: se2.Array, turn: float) -> float | None:
    straight = (np.abs(moved[:, 2]) < 0.05) & (moved[:, 0] > 0.3)
    if straight.sum() < 50:
        return None
    extra = se2.wrap_angle(counted[straight, 2] / turn - moved[straight, 2])
    return float(np.median(extra / moved[straight, 0]))


def _slips(
    t: NDArray[np.int64],
    told: se2.Array,
    made: se2.Array,
    first: NDArray[np.int64],
    last: NDArray[np.int64],
    off: NDArray[np.bool_],
) -> tuple[WheelSlip, ...]:
    spans: list[list[int]] = []
    for a, b in runs(off):
        low, high = int(first[a]), int(last[b - 1])
        if spans and t[low] - t[spans[-1][1]] < NEAR_NS:
            spans[-1][1] = high
        else:
            spans.append([low, high])
    found = []
    for low, high in spans:
        low, high = _trimmed(told, made, low, high)
        counted, moved = se2.between(told[low], told[high]), se2.between(made[low], made[high])
        apart = moved - counted
        metres, radians = float(np.hypot(apart[0], apart[1])), float(se2.wrap_angle(apart[2]))
        if metres < LEAST_M and abs(radians) < LEAST_RAD:
            continue
        moved_m, counted_m = _way(made[low : high + 1]), _way(told[low : high + 1])
        model = _model(moved_m, counted_m, apart, radians)
        found.append(
            WheelSlip(int(t[low]), int(t[high]), metres, radians, moved_m, counted_m, model)
        )
    return tuple(found)


def _way(path: se2.Array) -> float:
    """Length in m of a path (N, 3), by every fifth pose: noise between scans is no way."""
    rows = np.append(np.arange(0, len(path) - 1, 5), len(path) - 1)
    return float(np.hypot(*np.diff(path[rows, :2], axis=0).T).sum())


def _trimmed(told: se2.Array, made: se2.Array, low: int, high: int) -> tuple[int, int]:
    """The part in which the difference grew: a second's window smears its ends."""
    drift = se2.between(told[low], told[low : high + 1]) - se2.between(
        made[low], made[low : high + 1]
    )
    drift[:, 2] = se2.wrap_angle(drift[:, 2])
    grown = np.abs(np.diff(drift, axis=0)) @ np.array([1.0, 1.0, SLIP_M / SLIP_RAD])
    if not grown.sum() > 0.0:
        return low, high
    share = np.concatenate([[0.0], np.cumsum(grown) / grown.sum()])
    begin = low + int(np.searchsorted(share, 0.05, side="right")) - 1
    end = low + int(np.searchsorted(share, 0.95))
    return max(begin, low), min(max(end, begin + 1), high)


def _model(moved_m: float, counted_m: float, apart: se2.Array, radians: float) -> Model:
    if moved_m >= CARRIED_M and counted_m < CARRIED_SHARE * moved_m:
        return "carried"
    along = counted_m - moved_m
    if abs(along) >= max(LEAST_M, 0.1 * counted_m) or abs(along) >= 0.6 * float(
        np.hypot(apart[0], apart[1])
    ):
        return "spinning" if along > 0 else "sliding"
    return "turning" if abs(radians) >= LEAST_RAD else "sideways"
