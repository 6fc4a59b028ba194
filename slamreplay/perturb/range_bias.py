"""Ranges that are all too long, or all too short."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.perturb.beams import scan_beams
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class RangeBias:
    """Change every valid range alike; beams without a return stay what they are."""

    name: ClassVar[str] = "range_bias"
    variants: ClassVar[dict[str, Variant]] = {
        "offset": Variant("m", 0.0, "ranges are this much too long", -10, 10),
        "scale": Variant("ratio", 1.0, "measured over true range", 0.1, 10),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"scans"})

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with other ranges.

        Raises:
            NotApplicableError: the log has no scans.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        beams = scan_beams(view, self.name)
        ranges = beams.ranges_m[beams.returns[0]]
        changed = ranges + np.float32(level) if variant == "offset" else ranges * np.float32(level)
        return beams.with_returns(changed)
