"""An estimator that trusts motion more, or less, than it should."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from slamreplay.perturb.setting_scale import SettingScale
from slamreplay.perturb.variant import Variant


@dataclass(frozen=True)
class ProcessNoiseScale(SettingScale):
    """Scale the covariance of motion, Q, that an estimator is told; odometry itself stays.

    Of AMCL that are the alphas, variances per squared motion; of scan matching and of the pose
    graph the covariance of odometry. Below 1 it trusts odometry more.
    """

    name: ClassVar[str] = "process_noise_scale"
    variants: ClassVar[dict[str, Variant]] = {
        "covariance": Variant("ratio", 1.0, "Q times this", 1e-06, 1000000.0),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"process_noise_scale"})
