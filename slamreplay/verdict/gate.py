"""Does the uncertainty fit into the room there is?"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def ratio(sigma_m: float, clearance_m: float, sigmas: float = 3.0) -> float | None:
    """`sigmas` standard deviations over the clearance; None where there is no clearance left."""
    return sigmas * sigma_m / clearance_m if clearance_m > 0.0 else None


def allows(sigma_m: float, clearance_m: float, sigmas: float = 3.0) -> bool:
    """Whether `sigmas` standard deviations fit into the clearance.

    8 cm against 30 cm: 3 sigma is 24 cm, the motion may run. 11 cm: 33 cm, it is blocked.
    """
    return clearance_m > 0.0 and sigmas * sigma_m <= clearance_m


def sigma_towards(covariance: ArrayLike, direction_xy: ArrayLike) -> float | None:
    """Standard deviation in m of a position along a direction; None without a covariance.

    Args:
        covariance: (3, 3) or (2, 2), x and y first, m^2, in the axes of `direction_xy`.
        direction_xy: (2,) need not be of unit length.
    """
    P = np.asarray(covariance, dtype=np.float64)[:2, :2]
    u = np.asarray(direction_xy, dtype=np.float64)
    length = float(np.hypot(u[0], u[1]))
    if not np.isfinite(P).all() or not length > 0.0:
        return None
    variance = float(u @ P @ u) / length**2
    return float(np.sqrt(variance)) if variance >= 0.0 else None
