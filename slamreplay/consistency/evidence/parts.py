"""The parts of an error that are judged on their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from slamreplay.bundle.track import PoseTrack
from slamreplay.consistency.evidence.source import MAP_AXES, SPATIAL_AXES, Evidence
from slamreplay.consistency.statistics.whitening import whitened
from slamreplay.geometry.se2 import Array


class Held(Protocol):
    """Errors (N, m) and what is claimed for them (N, m, m): an `Evidence`, or a `Nees`."""

    @property
    def error(self) -> Array:
        """(N, m)."""

    @property
    def cov(self) -> Array:
        """(N, m, m)."""


@dataclass(frozen=True)
class Part:
    """Some axes of errors, and what they are called in a sentence."""

    name: str
    axes: tuple[int, ...]

    def white(self, held: Held) -> Array:
        """(N, m) whitened errors of these axes; NaN rows where they have no value."""
        index = list(self.axes)
        return whitened(held.error[:, index], held.cov[:, index][:, :, index])


POSE, POSITION, HEADING = Part("pose", (0, 1, 2)), Part("position", (0, 1)), Part("heading", (2,))
#: In space position and rotation are judged apart, so that it is told which of them is off.
SPATIAL = (Part("position", (0, 1, 2)), Part("rotation", (3, 4, 5)))
SPATIAL_POSE = Part("pose", (0, 1, 2, 3, 4, 5))


def exact_parts(
    evidence: Sequence[Evidence], updates: PoseTrack | None
) -> list[tuple[Evidence, Part]]:
    """The judged parts of the best source of which the covariance is claimed exactly.

    What shares evidence with the belief, or has only a bound of a covariance, is none: its errors
    are not distributed as it claims.
    """
    best = next((e for e in evidence if e.is_exact), None)
    if best is None or updates is None:
        return []
    return [(best, part) for part in judged_parts(best, updates)]


def judged_parts(evidence: Evidence, updates: PoseTrack) -> tuple[Part, ...]:
    """The whole pose where the belief couples position and heading, else both on their own.

    AMCL publishes no coupling, so that a joint value would only be an approximation.
    """
    if evidence.axes == SPATIAL_AXES:
        return SPATIAL
    if evidence.axes == MAP_AXES[:2]:
        return (POSITION,)
    if evidence.axes[2:] != MAP_AXES[2:]:
        return (Part("error", tuple(range(len(evidence.axes)))),)
    cross = updates.cov[:, :2, 2]
    coupled = bool((np.isfinite(cross) & (cross != 0.0)).any())
    return (POSE,) if coupled else (POSITION, HEADING)
