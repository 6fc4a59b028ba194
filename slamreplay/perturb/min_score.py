"""A loop closure that is taken in too easily, or never."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from slamreplay.perturb.setting_scale import SettingScale
from slamreplay.perturb.variant import Variant


@dataclass(frozen=True)
class MinScore(SettingScale):
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
