"""A localizer that says it is more, or less, sure than it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from slamreplay.perturb.setting_scale import SettingScale
from slamreplay.perturb.variant import Variant


@dataclass(frozen=True)
class PoseCovarianceScale(SettingScale):
    """Scale the covariance of every pose that an estimator gives out; its poses stay as they are.

    NEES and whoever acts by the covariance see it. It is done to what comes out of any estimator,
    so that the recorded one has it too, although it cannot be run again.
    """

    name: ClassVar[str] = "pose_covariance_scale"
    variants: ClassVar[dict[str, Variant]] = {
        "covariance": Variant("ratio", 1.0, "that of every pose times this", 1e-06, 1000000.0),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"pose_covariance_scale"})
