"""The one number a perturbation is turned up by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Literal

from slamreplay.errors import UsageError


@dataclass(frozen=True)
class Variant:
    """One way a perturbation can act.

    Attributes:
        unit: of the level.
        baseline: the level at which nothing changes.
        doc: what the level does, as one line.
        low: least level that makes sense.
        high: greatest one.
        is_switch: whether it is either left alone (0) or done (1), with nothing between.
    """

    unit: Literal["s", "m", "deg", "ratio"]
    baseline: float
    doc: str
    low: float = 0.0
    high: float = float("inf")
    is_switch: bool = False


def switch(doc: str) -> Variant:
    """A variant that is either left alone, 0, or done, 1."""
    return Variant("ratio", 0.0, doc, 0, 1, is_switch=True)


def check_level(name: str, variants: Mapping[str, Variant], variant: str, level: float) -> Variant:
    """The variant, if it exists and the level is one it can take.

    Raises:
        UsageError: no such variant, or a level that is no number, out of range, or between the two
            of a switch.
    """
    if variant not in variants:
        hint = f"there are: {', '.join(f'{name}.{v}' for v in variants)}"
        raise UsageError(f"there is no perturbation '{name}.{variant}'", hint=hint)
    found = variants[variant]
    if not (isfinite(level) and found.low <= level <= found.high):
        to = f"{found.low:g} to {found.high:g}" if isfinite(found.high) else f"{found.low:g} up"
        raise UsageError(f"level {level:g} of '{name}.{variant}' is not in {to} {found.unit}")
    if found.is_switch and level not in (0.0, 1.0):
        raise UsageError(
            f"level {level:g} of '{name}.{variant}' is neither 0 nor 1", hint="it is off or on"
        )
    return found
