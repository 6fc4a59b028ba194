"""Inertial measurements that never came."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.perturb.inertial import inertial
from slamreplay.perturb.lost import lost_at_random, lost_in_a_burst
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class ImuDrop:
    """Leave out messages of the unit that plays the role of the IMU.

    A higher ratio with the same seed loses the same and more; a longer burst contains the shorter
    one.
    """

    name: ClassVar[str] = "imu_drop"
    variants: ClassVar[dict[str, Variant]] = {
        "random": Variant("ratio", 0.0, "each message is lost with this probability", 0, 0.999),
        "burst": Variant("s", 0.0, "no message for this long, at a moment the seed chooses", 0,
                         3600),
    }  # fmt: skip
    touches: ClassVar[frozenset[str]] = frozenset({"imu"})

    def apply(
        self, view: BundleView, variant: str, level: float, rng: np.random.Generator
    ) -> BundleView:
        """The view without these messages.

        Raises:
            NotApplicableError: the log has no IMU, or less of it than the burst.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        unit = inertial(view, self.name)
        t_ns = unit.table.t_ns[unit.rows]
        if variant == "random":
            lost = lost_at_random(t_ns, level, rng)
        else:
            lost = lost_in_a_burst(t_ns, level, rng, self.name)
        keep = np.ones(len(unit.table), dtype=bool)
        keep[unit.rows[lost]] = False
        return view.with_table(unit.table.take(keep))
