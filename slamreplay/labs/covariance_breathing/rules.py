"""The numbers behind the words: when a sigma grows, a chain snaps tight, a belief has collapsed."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from slamreplay.labs.lab import Strict

Ratio = Annotated[float, Field(gt=0.0, le=1e3)]


class Rules(Strict):
    """When a word is used.

    Attributes:
        grows_from_ratio: largest sigma of the last quarter of the way over that of the second.
        tight_to_ratio: what the closure leaves of the last pose's sigma, at most.
        tight_to_chain_ratio: what it leaves of the whole chain's, root mean square, at most.
        collapsed_from_sigmas: root of the mean NEES over its degrees of freedom, at least.
        interval_miss_probability: how often a consistent filter's mean misses the interval.
    """

    grows_from_ratio: Ratio
    tight_to_ratio: Ratio
    tight_to_chain_ratio: Ratio
    collapsed_from_sigmas: Ratio
    interval_miss_probability: Annotated[float, Field(gt=0.0, lt=0.5)]
