"""Odometry that never came."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from slamreplay.bundle.tables import Table
from slamreplay.bundle.view import BundleView
from slamreplay.perturb.lost import lost_at_random, lost_in_a_burst
from slamreplay.perturb.odometry_path import told_odometry
from slamreplay.perturb.variant import Variant, check_level


@dataclass(frozen=True)
class OdometryDrop:
    """Leave out messages of odometry, on tf and on the topic alike.

    A message that is on both with one stamp is lost on both. A higher ratio with the same seed
    loses the same and more; a longer burst contains the shorter one.
    """

    name: ClassVar[str] = "odometry_drop"
    variants: ClassVar[dict[str, Variant]] = {
        "random": Variant("ratio", 0.0, "each message is lost with this probability", 0, 0.999),
        "burst": Variant(
            "s", 0.0, "no odometry for this long, at a moment the seed chooses", 0, 3600
        ),
    }
    touches: ClassVar[frozenset[str]] = frozenset({"odometry", "transforms"})

    def apply(
        self, view: BundleView, variant: str, level: float, rng: np.random.Generator
    ) -> BundleView:
        """The view without these messages.

        Raises:
            NotApplicableError: the log has no odometry, or less than the burst.
            UsageError: the level is out of range.
        """
        if level == check_level(self.name, self.variants, variant, level).baseline:
            return view
        told = told_odometry(view, self.name)
        table, transforms = view.table("odometry"), view.table("transforms")
        t_ns = np.concatenate([table.t_ns[told.topic], transforms.t_ns[told.tf]])
        if variant == "random":
            lost = lost_at_random(t_ns, level, rng)
        else:
            lost = lost_in_a_burst(t_ns, level, rng, self.name)
        n = len(told.topic)
        for one, rows in ((table, told.topic[lost[:n]]), (transforms, told.tf[lost[n:]])):
            view = view.with_table(_without(one, rows)) if len(rows) else view
        return view


def _without(table: Table, rows: np.ndarray) -> Table:
    keep = np.ones(len(table), dtype=bool)
    keep[rows] = False
    return table.take(keep)
