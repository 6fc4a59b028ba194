"""An estimator that trusts measurements more, or less, than it should."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from slamreplay.perturb.setting_scale import SettingScale
from slamreplay.perturb.variant import Variant


@dataclass(frozen=True)
class MeasurementNoiseScale(SettingScale):
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
