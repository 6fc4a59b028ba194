"""Two clocks of which one runs faster than the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.perturb.stamps import Stamps, odometry_stamps, scan_stamps
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class ClockSkew:
    """Let one clock gain on the others from its first stamp on, which stays as it is.

    Skew is the difference of two clocks' rates, seconds gained for each that passed: 1e-4 makes
    60 ms in ten minutes. A constant offset is `scan_delay` or, of odometry, `tf_delay`.
    """

    name: ClassVar[str] = "clock_skew"
    variants: ClassVar[dict[str, Variant]] = {
        "laser": Variant("ratio", 0.0, "scan stamps gain so many seconds each second", -0.5, 0.5),
        "odometry": Variant(
            "ratio", 0.0, "odometry stamps, on topic and tf, gain so many a second", -0.5, 0.5
        ),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"scans", "odometry", "transforms"})

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with other stamps.

        Raises:
            NotApplicableError: the log has no scans, or no odometry.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        stamps: Stamps = (scan_stamps if variant == "laser" else odometry_stamps)(view, self.name)
        passed = stamps.t_ns - stamps.t_ns[0]
        return stamps.moved(np.rint(passed * level).astype(np.int64))
