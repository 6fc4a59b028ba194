"""A localizer that says it is more, or less, sure than it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class PoseCovarianceScale:
    """Scale the covariance of every pose that an estimator gives out; its poses stay as they are.

    NEES and whoever acts by the covariance see it. It is done to what comes out of any estimator,
    so that the recorded one has it too, although it cannot be run again.
    """

    name: ClassVar[str] = "pose_covariance_scale"
    variants: ClassVar[dict[str, Variant]] = {
        "covariance": Variant("ratio", 1.0, "that of every pose times this", 1e-06, 1000000.0),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"pose_covariance_scale"})

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with the setting that the runner of trials honours.

        Raises:
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        return view.with_setting("pose_covariance_scale", level)
