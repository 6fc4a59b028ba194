"""Beams that say nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.perturb.beams import scan_beams
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class BeamDrop:
    """Take away beams of the laser that plays the scan role: they become NaN, no free space.

    A higher level with the same seed takes the same beams and more.
    """

    name: ClassVar[str] = "beam_drop"
    variants: ClassVar[dict[str, Variant]] = {
        "random": Variant("ratio", 0.0, "each beam is lost with this probability", 0, 1),
        "field_of_view": Variant(
            "deg",
            0.0,
            "the field of view is narrower by this much, half of it on each side",
            0,
            360,
        ),
        "sector": Variant(
            "deg", 0.0, "this much is blocked about the middle of the field of view", 0, 360
        ),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"scans"})

    def apply(
        self, view: BundleView, variant: str, level: float, rng: np.random.Generator
    ) -> BundleView:
        """The view with fewer beams.

        Raises:
            NotApplicableError: the log has no scans.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        beams = scan_beams(view, self.name)
        if variant == "random":
            return beams.without(rng.random(len(beams.ranges_m), dtype=np.float32) < level)
        if variant == "sector":
            return beams.without(beams.off_middle_rad < np.radians(level) / 2.0)
        left = beams.spread(beams.field_rad) - np.radians(level)
        return beams.without(beams.off_middle_rad > left / 2.0)
