"""A particle filter with fewer particles, or more."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from slamreplay.perturb.setting_scale import SettingScale
from slamreplay.perturb.variant import Variant


@dataclass(frozen=True)
class ParticleCount(SettingScale):
    """Scale the least and the greatest number of particles that are configured."""

    name: ClassVar[str] = "particle_count"
    variants: ClassVar[dict[str, Variant]] = {
        "scale": Variant("ratio", 1.0, "both numbers of particles times this", 0.001, 100),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"particle_count"})
