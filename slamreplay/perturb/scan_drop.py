"""Scans that never came."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.perturb.lost import lost_in_a_burst
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class ScanDrop:
    """Leave out scans of the laser that plays the scan role.

    A higher ratio with the same seed drops the same scans and more where they are drawn at random;
    a longer burst contains the shorter one.
    """

    name: ClassVar[str] = "scan_drop"
    variants: ClassVar[dict[str, Variant]] = {
        "random": Variant("ratio", 0.0, "each scan is lost with this probability", 0, 0.999),
        "burst": Variant("s", 0.0, "no scan for this long, at a moment the seed chooses", 0, 3600),
        "even": Variant("ratio", 0.0, "this share of the scans is lost, evenly spread", 0, 0.999),
        "nth": Variant(
            "ratio",
            0.0,
            "at 1/n each n-th scan is lost, at 1 - 1/n only each n-th comes; else the nearest",
            0,
            0.999,
        ),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"scans"})

    def apply(
        self, view: BundleView, variant: str, level: float, rng: np.random.Generator
    ) -> BundleView:
        """The view without those scans.

        Raises:
            NotApplicableError: the log has no scans, or is shorter than the burst.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        table = view.table("scans")
        rows = np.flatnonzero(table["topic"] == view.manifest.topic_of("scan"))
        if not len(rows):
            raise NotApplicableError("the log has no scans to drop", where=self.name)
        rows = rows[np.argsort(table.t_ns[rows], kind="stable")]
        if variant == "random":
            drop = rng.random(len(rows)) < level
        elif variant == "even":
            counted = np.floor((np.arange(len(rows) + 1)) * level)
            drop = np.diff(counted) > 0
        elif variant == "nth":
            drop = _every_nth(len(rows), level)
        else:
            drop = lost_in_a_burst(table.t_ns[rows], level, rng, self.name)
        keep = np.ones(len(table), dtype=bool)
        keep[rows[drop]] = False
        return view.with_table(table.take(keep))


def _every_nth(count: int, level: float) -> NDArray[np.bool_]:
    """(N,) which of so many scans are lost where the pattern has a whole period."""
    share = min(level, 1.0 - level)
    around = (np.floor(1.0 / share), np.ceil(1.0 / share))
    n = max(2.0, min(around, key=lambda n: abs(1.0 / n - share)))
    is_nth = (np.arange(count) + 1) % n == 0
    return is_nth if level <= 0.5 else ~is_nth
