"""Wheels that turn otherwise than the robot moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.geometry.se2 import Array
from slamreplay.geometry.times import NS_PER_S, Times
from slamreplay.perturb.driven import Driven, driven, moment
from slamreplay.perturb.odometry_path import Change, Twists, retold, turns_of, with_odometry
from slamreplay.perturb.variant import Variant, check_level

#: A heading is lost on so much of the way, m: a wheel slips on a threshold or a wet spot.
_SPOT_M = 0.3
#: From here on the robot turns, rad/s; below it drives, however crooked.
_TURNING_RAD_S = np.radians(6.0)
#: Velocities that are told are means over so long to either side.
_AROUND_NS = NS_PER_S // 40


@dataclass(frozen=True)
class OdometrySlip:
    """Let wheels slip: what they tell and what was driven part ways at one place, or in turns.

    Above zero wheels spin, so that odometry tells more than was driven; below zero the robot
    slides or is pushed, and odometry tells less. `window` begins at a place on the way that the
    seed chooses, and lasts for as many metres of driving as its level: from there on each metre is
    told as two, or as none. A longer one contains the shorter one of the same seed. `turn` tells a
    turn that was not made, on 0.3 m of the way. `per_turn` acts while the robot turns faster than
    6 deg/s only: what skid-steered wheels do in every bend.
    """

    name: ClassVar[str] = "odometry_slip"
    variants: ClassVar[dict[str, Variant]] = {
        "window": Variant(
            "m", 0.0, "told and not driven (below 0: driven, not told), at one place", -1e4, 1e4
        ),
        "turn": Variant(
            "deg", 0.0, "told as turned to the left and not turned, at one place", -180, 180
        ),
        "per_turn": Variant("ratio", 0.0, "of every turn, told and not turned", -1, 10),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"odometry", "transforms"})

    def apply(
        self, view: BundleView, variant: str, level: float, rng: np.random.Generator
    ) -> BundleView:
        """The view with other odometry.

        Raises:
            NotApplicableError: the log has no odometry, or the robot does not drive that far, or
                does not turn.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        way = driven(view, self.name)
        if variant == "window":
            start = moment(way, abs(level), rng, self.name)
            return with_odometry(view, self.name, *_stretched(way, start, level))
        if variant == "turn":
            start = moment(way, _SPOT_M, rng, self.name)
            turn = float(np.radians(level))
            return with_odometry(view, self.name, *_swerving(way, start, turn))
        if not way.yaw_in_turns_at(way.t_ns, _TURNING_RAD_S).any():
            raise NotApplicableError("the robot does not turn in this log", where=self.name)
        return with_odometry(view, self.name, *_oversteered(way, level))


def _stretched(way: Driven, start_m: float, level: float) -> tuple[Change, Twists]:
    """Steps that are told twice, or not at all, for so many metres of the way."""

    def inside(t_ns: Times) -> Array:
        return np.clip(way.distance_at(t_ns) - start_m, 0.0, abs(level))

    def change(t_ns: Times, xyyaw: Array) -> Array:
        length = np.diff(way.distance_at(t_ns))
        share = np.diff(inside(t_ns)) / np.where(length > 0.0, length, 1.0)
        return retold(xyyaw, 1.0 + np.sign(level) * share, turns_of(xyyaw)[:, 2])

    def twists(t_ns: Times, linear: Array, angular: Array) -> tuple[Array, Array]:
        before, after = (t_ns - _AROUND_NS), (t_ns + _AROUND_NS)
        length = way.distance_at(after) - way.distance_at(before)
        share = (inside(after) - inside(before)) / np.where(length > 0.0, length, 1.0)
        return linear * (1.0 + np.sign(level) * share)[:, None], angular

    return change, twists


def _swerving(way: Driven, start_m: float, turn: float) -> tuple[Change, Twists]:
    """A turn (rad) more, spread over the slippery spot."""
    return _turning(
        lambda t_ns: turn * np.clip((way.distance_at(t_ns) - start_m) / _SPOT_M, 0.0, 1.0)
    )


def _oversteered(way: Driven, level: float) -> tuple[Change, Twists]:
    """Turns that are told larger by this share of them."""
    return _turning(lambda t_ns: level * way.yaw_in_turns_at(t_ns, _TURNING_RAD_S))


def _turning(turned: Callable[[Times], Array]) -> tuple[Change, Twists]:
    """Turns that are told beside those that are: rad until times (N,)."""

    def change(t_ns: Times, xyyaw: Array) -> Array:
        return retold(xyyaw, 1.0, turns_of(xyyaw)[:, 2] + np.diff(turned(t_ns)))

    def twists(t_ns: Times, linear: Array, angular: Array) -> tuple[Array, Array]:
        more = turned(t_ns + _AROUND_NS) - turned(t_ns - _AROUND_NS)
        rate = more * NS_PER_S / (2 * _AROUND_NS)
        return linear, np.column_stack([angular[:, :2], angular[:, 2] + rate])

    return change, twists
