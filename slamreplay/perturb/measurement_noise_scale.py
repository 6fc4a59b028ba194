"""An estimator that trusts measurements more, or less, than it should."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class MeasurementNoiseScale:
    """Scale the covariance of measurements, R, that an estimator is told; what is recorded stays.

    Of AMCL that is `sigma_hit` squared; of scan matching and of the pose graph the covariance of
    matches. Below 1 it trusts measurements more. Dead reckoning, which measures nothing, does not
    have the setting.
    """

    name: ClassVar[str] = "measurement_noise_scale"
    variants: ClassVar[dict[str, Variant]] = {
        "covariance": Variant("ratio", 1.0, "R times this", 1e-06, 1000000.0),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"measurement_noise_scale"})

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
        return view.with_setting("measurement_noise_scale", level)
