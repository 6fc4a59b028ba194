"""Stamps that are early or late by chance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.geometry.times import NS_PER_S
from slamreplay.perturb.stamps import Stamps, odometry_stamps, scan_stamps
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class StampJitter:
    """Move every stamp by independent normal noise, as a driver does that stamps when it has time.

    No stamp overtakes another: the noisy stamps are given out in order, for a driver stamps what
    comes first first. Where the noise is wider than the time between two messages, a stamp is
    therefore off by less than the level. Messages of one stamp keep one stamp. A higher level with
    the same seed is the same noise, magnified.
    """

    name: ClassVar[str] = "stamp_jitter"
    variants: ClassVar[dict[str, Variant]] = {
        "scans": Variant("s", 0.0, "standard deviation of the error of scan stamps", 0, 10),
        "odometry": Variant(
            "s", 0.0, "standard deviation of the error of odometry stamps, on topic and tf", 0, 10
        ),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"scans", "odometry", "transforms"})

    def apply(
        self, view: BundleView, variant: str, level: float, rng: np.random.Generator
    ) -> BundleView:
        """The view with other stamps.

        Raises:
            NotApplicableError: the log has no scans, or no odometry.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        stamps: Stamps = (scan_stamps if variant == "scans" else odometry_stamps)(view, self.name)
        noise_ns = np.rint(rng.standard_normal(len(stamps.t_ns)) * (level * NS_PER_S))
        noisy = np.sort(stamps.t_ns + noise_ns.astype(np.int64))
        return stamps.moved(noisy - stamps.t_ns)
