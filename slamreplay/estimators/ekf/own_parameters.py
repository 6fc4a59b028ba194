"""Parameters of our own estimators, by the names of their attributes and of their noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from math import isfinite
from typing import Any

from slamreplay.errors import UsageError
from slamreplay.estimators.ekf.noise import Noise
from slamreplay.estimators.parameters import unknown_parameter


def numbers_of(
    cls: type, given: Mapping[str, object], where: str, others: tuple[str, ...] = ()
) -> tuple[dict[str, Any], Noise]:
    """Numbers for an estimator's own attributes, and its noise.

    Args:
        cls: the estimator, a dataclass with numbers beside `noise`.
        given: parameters.
        where: its name.
        others: further names that somebody may have meant.

    Raises:
        UsageError: a parameter that there is not (with the nearest one), or no number.
    """
    own = {item.name for item in fields(cls)} - {"noise", "node"}
    of_noise = {item.name for item in fields(Noise)}
    values: dict[str, dict[str, Any]] = {"own": {}, "noise": {}}
    for name, value in given.items():
        if name not in own | of_noise:
            raise unknown_parameter(name, (*own, *of_noise, *others), where)
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            raise UsageError(f"'{name}' is {value!r}: it should be a number", where=where)
        values["own" if name in own else "noise"][name] = float(value)
    return values["own"], Noise(**values["noise"])
