"""Scans that are stamped too late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.view import BundleView
from slamreplay.errors import NotApplicableError
from slamreplay.geometry.times import ns
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class ScanDelay:
    """Stamp scans later than they were measured, as a driver does that stamps on arrival."""

    name: ClassVar[str] = "scan_delay"
    variants: ClassVar[dict[str, Variant]] = {
        "stamp": Variant("s", 0.0, "scans carry stamps this much too late", 0, 60),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"scans"})

    def apply(
        self,
        view: BundleView,
        variant: str,
        level: float,
        rng: np.random.Generator,  # noqa: ARG002 - nothing is random
    ) -> BundleView:
        """The view with later scans.

        Raises:
            NotApplicableError: the log has no scans.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        table = view.table("scans")
        late = table["topic"] == view.manifest.topic_of("scan")
        if not late.any():
            raise NotApplicableError("the log has no scans to delay", where=self.name)
        return view.with_table(table.replace(t_ns=table.t_ns + np.where(late, ns(level), 0)))
