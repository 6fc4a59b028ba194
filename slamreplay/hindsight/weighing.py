"""Scan and odometry weighed against each other: along a bare wall only odometry knows the way."""

from __future__ import annotations

import numpy as np

from slamreplay.geometry import se2
from slamreplay.matching.correlative import Match

#: What odometry misses between two keyframes: a floor and a part of the way, a radian of turning
#: being so many metres of it.
FLOOR_M, FLOOR_RAD, PART, LEVER_M = 0.01, 0.01, 0.1, 0.2
#: The curvature of a score is known to this part of one point's, times the root of their number.
NOISE = 0.3
#: Beyond so many standard deviations of both the match refutes odometry.
REFUTED = 3.0


def weighed(guess: se2.Array, laid: Match, way: se2.Array, count: int, sigma_m: float) -> se2.Array:
    """The match as far as the scan holds it, and odometry where it does not: (3,).

    Both are Gaussian and weighed by information; what the match's curvature has by chance alone
    does not count. Odometry that the scan refutes (a slip, a robot that is carried) has no say.

    Args:
        guess: (3,) where odometry puts the scan, m, m, rad.
        laid: where it fits.
        way: (3,) the motion by odometry from the scan before.
        count: how many points the scan has.
        sigma_m: of the field that it was matched to.
    """
    turn = float(abs(way[2]))
    spread_m = FLOOR_M + PART * (float(np.hypot(way[0], way[1])) + LEVER_M * turn)
    variance = np.array([spread_m, spread_m, FLOOR_RAD + PART * turn]) ** 2
    values, axes = np.linalg.eigh(laid.information)
    values = np.maximum(values - NOISE * np.sqrt(count) / sigma_m**2, 0.0)
    off = np.append(laid.xyyaw[:2] - guess[:2], se2.wrap_angle(laid.xyyaw[2] - guess[2]))
    # An axis without hold has no value, and nothing to refute with.
    if np.any(values * (axes.T @ off) ** 2 > REFUTED**2 * (1.0 + values * (axes.T**2 @ variance))):
        return laid.xyyaw
    held = (axes * values) @ axes.T
    return np.asarray(guess + np.linalg.solve(np.diag(1.0 / variance) + held, held @ off))
