"""An estimator that trusts motion more, or less, than it should."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class ProcessNoiseScale:
    """Scale the covariance of motion, Q, that an estimator is told; odometry itself stays.

    Of AMCL that are the alphas, variances per squared motion; of scan matching and of the pose
    graph the covariance of odometry. Below 1 it trusts odometry more.
    """

    name: ClassVar[str] = "process_noise_scale"
    variants: ClassVar[dict[str, Variant]] = {
        "covariance": Variant("ratio", 1.0, "Q times this", 1e-06, 1000000.0),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"process_noise_scale"})

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
        return view.with_setting("process_noise_scale", level)
