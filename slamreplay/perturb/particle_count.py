"""A particle filter with fewer particles, or more."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class ParticleCount:
    """Scale the least and the greatest number of particles that are configured."""

    name: ClassVar[str] = "particle_count"
    variants: ClassVar[dict[str, Variant]] = {
        "scale": Variant("ratio", 1.0, "both numbers of particles times this", 0.001, 100),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"particle_count"})

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with the setting that estimators honour.

        Raises:
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        return view.with_setting("particle_count", level)
