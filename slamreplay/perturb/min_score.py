"""A loop closure that is taken in too easily, or never."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class MinScore:
    """Scale the score that a loop closure of the pose graph has to reach.

    It is a ratio of what is configured, so that it means the same for every configuration: 0.55,
    the default, becomes 0.275 at a level of 0.5, and no closure can reach it at 2. Scan matching
    goes by what matches usually score and does not have the setting.
    """

    name: ClassVar[str] = "min_score"
    variants: ClassVar[dict[str, Variant]] = {
        "scale": Variant("ratio", 1.0, "the least score times this", 0, 100),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"min_score"})

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
        return view.with_setting("min_score", level)
