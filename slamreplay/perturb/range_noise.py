"""Ranges that scatter more than the laser's do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.perturb.beams import scan_beams
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class RangeNoise:
    """Add independent normal noise to every valid range, on top of the laser's own.

    A higher level with the same seed is the same noise, magnified.
    """

    name: ClassVar[str] = "range_noise"
    variants: ClassVar[dict[str, Variant]] = {
        "gaussian": Variant("m", 0.0, "standard deviation of what is added to a range", 0, 10),
        "proportional": Variant("ratio", 0.0, "that standard deviation over the range", 0, 1),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"scans"})

    def apply(
        self, view: BundleView, variant: str, level: float, rng: np.random.Generator
    ) -> BundleView:
        """The view with other ranges.

        Raises:
            NotApplicableError: the log has no scans.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        beams = scan_beams(view, self.name)
        hits = beams.returns[0]
        ranges = beams.ranges_m[hits]
        noise = rng.standard_normal(len(hits), dtype=np.float32)[hits] * np.float32(level)
        return beams.with_returns(
            ranges + noise if variant == "gaussian" else ranges * (np.float32(1.0) + noise)
        )
