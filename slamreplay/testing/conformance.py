"""What every check of the kit shares: its failure, and what no plug-in may touch."""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import is_dataclass
from typing import Any

import numpy as np


class ConformanceError(AssertionError):
    """A plug-in broke the contract; the message says which part and how."""


def demand(condition: object, message: str) -> None:
    """Raise ConformanceError unless `condition` holds."""
    if not condition:
        raise ConformanceError(message)


def demand_frozen_dataclass(thing: Any) -> None:
    """Plug-ins are frozen dataclasses: hyper-parameters in, nothing else, nothing changes."""
    frozen = is_dataclass(thing) and getattr(type(thing), "__dataclass_params__").frozen  # noqa: B009
    demand(frozen, f"{type(thing).__name__} is no frozen dataclass")
    demand(
        isinstance(getattr(thing, "name", None), str), f"{type(thing).__name__} has no name: str"
    )


@contextmanager
def untouched_global_rng(name: str) -> Iterator[None]:
    """Fail if the block draws from, or seeds, a random generator that everybody shares."""
    before = _global_states()
    yield
    demand(
        _global_states() == before,
        f"{name} uses a global random generator: take the one that is given, or the seed",
    )


def _global_states() -> tuple[object, ...]:
    _, keys, *rest = np.random.get_state()  # noqa: NPY002 - it is looked at, not used
    return (np.asarray(keys).tobytes(), *rest, random.getstate())
