"""Sentences about what was tried."""

from __future__ import annotations

import numpy as np


def apart(metres: float, radians: float) -> str:
    """A distance and a turn."""
    return f"{metres:.2f} m and {np.degrees(radians):.0f} deg"
