"""What perturbations share that scale one number an estimator is configured with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class SettingScale:
    """The view asks for the setting of the perturbation's own name, at the level; 1 asks nothing.

    Whoever has the setting multiplies by it: the estimators, or the runner of trials.
    """

    name: ClassVar[str]
    variants: ClassVar[dict[str, Variant]]
    touches: ClassVar[frozenset[str]]

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with the setting.

        Raises:
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        return view.with_setting(self.name, level)
